"""Wheel ticks on four lines: counted, counted on although nobody reads, owned by one, and pulled out."""

from __future__ import annotations

import itertools
import os
import select
from typing import Any

from kernel.guest.gpio import SimulatedGpio, read_edges, request_rising_edges

NAMES = ["front left", "front right", "rear left", "rear right"]
BUFFER = 1024


def run(pulses: list[int], unread: int) -> dict[str, Any]:
    """`pulses` on each line, then `unread` on line 0 before the buffer is read, then the chip goes."""
    chip = SimulatedGpio(NAMES)
    edges = request_rising_edges(chip.device, list(range(len(NAMES))), BUFFER)
    for line, times in enumerate(pulses):
        chip.pulse(line, times)
    seen: dict[str, Any] = {
        "read": [edge[1:] for edge in read_edges(edges, sum(pulses))],
        "errno of a second owner": errno_of_request(chip),
    }
    chip.pulse(0, unread)
    kept = read_edges(edges, BUFFER)
    seen["kept"] = [kept[0].line_number, kept[-1].line_number, len(kept)]
    seen["times rise"] = all(before.time_ns < now.time_ns for before, now in itertools.pairwise(kept))
    chip.unplug()
    return {**seen, **after_loss(edges)}


def errno_of_request(chip: SimulatedGpio) -> int | None:
    """Of lines that we own already."""
    try:
        request_rising_edges(chip.device, [0], 16)
    except OSError as error:
        return error.errno
    return None


def after_loss(edges: int) -> dict[str, Any]:
    """poll's answer on an open request, and what reading says."""
    poll = select.poll()
    poll.register(edges, select.POLLIN)
    ((_, events),) = poll.poll(60_000)
    try:
        return {"poll after loss": events, "read after loss": len(os.read(edges, 48))}
    except OSError as error:
        return {"poll after loss": events, "errno after loss": error.errno}
