"""One module per job: `run(**arguments)` observes in the guest; what it returns is judged by a test on the host."""
