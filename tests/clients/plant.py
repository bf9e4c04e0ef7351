"""A pendulum that a host drives over lines of JSON, or one that misbehaves in the way that its argument names.

q = 0 is upright, as in the built-in system `pendulum`.
"""

import json
import math
import os
import sys
import time

FAULT = sys.argv[1] if len(sys.argv) > 1 else "none"
STEP_S = 0.02
HELLO = {
    "type": "hello",
    "protocol": 1,
    "name": "pendulum in Python",
    "joints": ["pivot"],
    "step_s": STEP_S,
    "command": "torque",
    "clock": "simulated",
    "limits": {"command": [[-3.0, 3.0]], "rate": [100.0]},
    "safe": [0.0],
    "measured": ["voltage"],
}


def say(message):
    write(json.dumps(message) + "\n")


def write(text):
    sys.stdout.buffer.write(text if isinstance(text, bytes) else text.encode())
    sys.stdout.flush()


def moved(state, torque):
    q, qd = state
    for _ in range(50):
        qd += STEP_S / 50 * (15.0 * math.sin(q) + 3.0 * torque)
        q += STEP_S / 50 * qd
    return q, qd


def row(number, state, **other):
    q, qd = state
    time_s = {"past": 0.0, "repeated": STEP_S}.get(FAULT) if number > 1 else None
    time_s = STEP_S * number if time_s is None else time_s
    entry = {"time": time_s, "q": [q], "qd": [qd], "command": number, "measured": {"voltage": 24.0}}
    return {**entry, **other}


def answer(number, state):
    """The answer to a step, in which most faults are."""
    rows = {"type": "rows", "rows": [row(number, state)]}
    if FAULT == "unsolicited":
        say(rows)
    if number < 3 or FAULT in ("none", "past", "repeated", "unsolicited", "counting"):
        say(rows)
    elif FAULT == "flood":
        for later in range(100_000):
            say({"type": "rows", "rows": [row(number + later, state)]})
    elif FAULT == "torn":
        write('{"type":"rows","rows":[{"ti')
        sys.exit(0)
    elif FAULT == "silent":
        time.sleep(600)
    elif FAULT == "closes":
        os.close(1)
        time.sleep(600)
    else:
        write(
            {
                "dies": b"",
                "garbage": b"Traceback (most recent call last):\n",
                "binary": bytes(range(128, 256)) + b"\n",
                "long": b'{"type":"rows","rows":"' + b"x" * 1_000_000 + b'"}\n',
                "deep": b"[" * 100_000 + b"\n",
                "null": b"null\n",
                "no rows": b'{"type":"rows","rows":[]}\n',
                "type": b'{"type":"row"}\n',
                "hello": (json.dumps(HELLO) + "\n").encode(),
                "joints": (json.dumps({**rows, "rows": [row(number, state, q=[0.0, 0.0])]}) + "\n").encode(),
                "infinite": b'{"type":"rows","rows":[{"time":0.06,"q":[1e999],"command":3}]}\n',
                "nan": b'{"type":"rows","rows":[{"time":0.06,"q":[NaN],"command":3}]}\n',
                "huge": b'{"type":"rows","rows":[{"time":0.06,"q":[1e31],"command":3}]}\n',
                "command": (json.dumps({**rows, "rows": [row(number, state, command=77)]}) + "\n").encode(),
                "old command": (json.dumps({**rows, "rows": [row(number, state, command=1)]}) + "\n").encode(),
                "error": b'{"type":"error","message":"the belt has \\u001b[31mcome off"}\n',
            }[FAULT]
        )
        if FAULT == "dies":
            os._exit(3)


def hello():
    changed = {
        "protocol": {"protocol": 2},
        "no joints": {"joints": []},
        "safe": {"safe": [0.0, 0.0]},
        "limits": {"limits": {"command": [[3.0, -3.0]]}},
        "unsafe": {"safe": [5.0]},
        "step": {"step_s": 0.0},
        "name": {"name": "a\u001b[31mb"},
        "measured": {"measured": ["a,b\n"]},
    }.get(FAULT, {})
    say({**HELLO, **changed})


def count(rows):
    """Keep the number of rows of the episode where no death touches it."""
    if FAULT == "counting":
        with open("new", "w") as file:
            file.write(str(rows))
        os.replace("new", "rows")


if FAULT == "counting":
    with open("pid", "w") as file:
        file.write(str(os.getpid()))
if FAULT == "mute":
    sys.exit(0)
if FAULT == "early":
    say({"type": "rows", "rows": [row(0, (math.pi, 0.0))]})

state = (math.pi, 0.0)
for line in sys.stdin:
    message = json.loads(line)
    match message["type"]:
        case "hello":
            hello()
        case "reset":
            state = tuple(message.get("start", [math.pi, 0.0]))
            count(1)
            say({"type": "rows", "rows": [row(0, state)]})
        case "step":
            (torque,) = message["command"]
            if abs(torque) > 3.0:
                say({"type": "error", "message": f"{torque} N m is more than this motor has"})
            state = moved(state, torque)
            count(message["id"] + 1)
            answer(message["id"], state)
        case "stop":
            print("stopped", file=sys.stderr)
            say({"type": "stopped"})
            break
