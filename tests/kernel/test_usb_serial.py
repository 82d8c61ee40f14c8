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


RANGES = "R,a,3.41;b,5.02,0.1\n"
SHELL = "DIST,2,AN0,0A1B,0.00,0.00,0.00,1.25,AN1,15BA,4.00,0.00,0.00,2.50,POS,1.00,2.00,0.10,77\r\n"


def test_the_uwb_drivers_are_lost_once_and_back_once_over_a_cable_pulled_out(run_job):
    """Five ranges before and five after; the DWM1001 woke up in its binary mode both times."""
    seen = run_job("uwb_drivers", line=RANGES, dwm1001=SHELL).answer
    heard = {"lines": [["a", 3.41], ["b", 5.02]], "dwm1001": [["0A1B", 1.25], ["15BA", 2.5]]}
    for name, one in heard.items():
        told = seen[name]
        assert told["ranges"] == [one] * 10, name
        assert [level for level, _ in told["diagnostics"]] == ["WARN", "OK"], name
        assert "/dev/ttyACM0 went away" in told["diagnostics"][0][1]
        assert told["diagnostics"][1][1] == "uwb is back"
        assert told["losses"] == 1
        assert told["found"] == ["/dev/ttyACM0"]
