"""The kernel tier: the real drivers of a real Debian kernel, in an emulated machine without any hardware.

On the host: `machine` says what is needed and where it lies, `fetch` brings it, `initramfs` and `boot` run one job.
In the guest: `guest` has the simulated devices and plain ways to read them, `jobs` one module per job.
"""
