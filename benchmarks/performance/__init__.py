"""The speed of the estimators beside other libraries, and the laws by which cost grows."""
