"""A USB serial device behind the real cdc_acm, unplugged while open and plugged in again."""

import errno

import pytest

pytestmark = pytest.mark.kernel

LINE = "POS,1.25,-0.50,0.00,87\r\n"


def test_a_port_pulled_out_while_open_says_so_and_speaks_again_when_back(run_job):
    seen = run_job("usb_serial", line=LINE).answer
    assert seen == {
        "usb id": "0525:a4a7",
        "before": LINE,
        "open port": {"hung up": True, "read": ""},
        "open without node": errno.ENOENT,
        "after": LINE,
    }
