"""What runs inside the guest: standard library only, since every import is paid for in emulation."""
