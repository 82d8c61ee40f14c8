"""A robot file for tests: the sensors of a simulated robot in a small room."""

KINDS = {
    "encoders": "simulated_encoders",
    "gyro": "simulated_gyro",
    "motors": "simulated_motors",
    "truth": "simulated_tracker",
    "wifi": "simulated_wifi",
}


def robot_text(*, record="min_free_mb = 0.0", faults=None, required=None, leave_out=()):
    """The text of a robot file; ``faults`` and ``required`` by the name of a sensor."""
    rows = ['world = "room"', "[start]", "position_m = [1.0, 1.0]", "heading_deg = 0.0", "[record]", record]
    for name, use in KINDS.items():
        if name in leave_out:
            continue
        rows += ["[[sensors]]", f'name = "{name}"', f'use = "{use}"']
        rows += [f"required = {str(required[name]).lower()}"] if required and name in required else []
        rows += [f'settings = {{ scenario = "room", faults = [{(faults or {}).get(name, "")}] }}']
    return "\n".join(rows) + "\n"
