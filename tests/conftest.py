"""What holds for all tests."""

from hypothesis import settings

# A deadline measures the machine's load, not the code; speed is measured elsewhere.
settings.register_profile("fusion", deadline=None, derandomize=True)
settings.load_profile("fusion")
