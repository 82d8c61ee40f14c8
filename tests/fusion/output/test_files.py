"""Results are written whole, or not at all."""

import os
import resource
from contextlib import contextmanager
from pathlib import Path

import pytest

from fusion import FusionError
from fusion.output.files import write


@contextmanager
def full_disk(most):
    """No file grows beyond ``most`` bytes: what is beyond fails as on a disk that fills up."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_result_that_does_not_fit_leaves_no_half_file_and_keeps_the_one_before(tmp_path):
    for place in (tmp_path / "new.bin", tmp_path / "old.bin"):
        if place.name == "old.bin":
            write(place, b"before")
        with full_disk(1_000), pytest.raises(FusionError, match=rf"{place}: cannot be written \(.*\); give another"):
            write(place, bytes(2_000))
    assert [path.name for path in tmp_path.iterdir()] == ["old.bin"]
    assert (tmp_path / "old.bin").read_bytes() == b"before"


def test_file_keeps_its_mode_and_a_link_stays_one(tmp_path):
    place, link = tmp_path / "result.txt", tmp_path / "link"
    write(place, b"1")
    assert place.stat().st_mode & 0o777 == 0o666 & ~_umask()
    place.chmod(0o600)
    link.symlink_to(place)
    write(link, b"2")
    assert link.is_symlink()
    assert (place.read_bytes(), place.stat().st_mode & 0o777) == (b"2", 0o600)


def _umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
def test_device_is_written_to_and_stays_one():
    write(Path(os.devnull), b"gone")
    assert not Path(os.devnull).is_file()
    with pytest.raises(FusionError, match="No space left on device"):
        write(Path("/dev/full"), b"gone")
    assert not Path("/dev/full").is_file()
