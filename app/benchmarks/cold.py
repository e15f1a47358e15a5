"""The first plan of a process: how long a place takes to open in a new one, and then its first plan.

Kernels are in their cache, as they are after the first time that a place was opened.
"""

import json
import statistics
import subprocess
import sys

_CHILD = """
import json, sys
from nerfnav_app.jobs.plan.first_plan import first_plan
print(json.dumps(first_plan(sys.argv[1])))
"""


def measure(place: str, rounds: int = 3) -> dict[str, float]:
    """Median times [s] over new processes: what must be imported, the place opened, its first task planned.

    One process more goes first, whose times do not count: it compiles what has not been compiled yet.
    """
    found = [_in_a_new_process(place) for _ in range(rounds + 1)][1:]
    return {name: statistics.median(row[name] for row in found) for name in found[0]}


def _in_a_new_process(place: str) -> dict[str, float]:
    done = subprocess.run([sys.executable, "-c", _CHILD, place], stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout)
