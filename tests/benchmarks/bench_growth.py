"""How the time of a solve grows with the number of profiles: exponent, and beside the time of measuring them."""

import time

import numpy as np
from harness import Row

from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.chain.tcp import solve_tcp
from calib_core.simulation.trouble.cell import Plan, Trouble, troubled


def run(full: bool) -> list[Row]:
    """Return the rows; `full` goes to 2,000 profiles, otherwise to 400."""
    sizes = (100, 500, 2000) if full else (100, 400)
    timed(15)  # compiles and imports
    times = np.array([timed(size) for size in sizes])
    measuring, solving = times.T
    slope = float(np.log(times[-1].sum() / times[0].sum()) / np.log(sizes[-1] / sizes[0]))
    rows = [
        Row(f"{size} profiles: measuring, solving", "", f"{m:.2f} s, {s:.2f} s")
        for size, (m, s) in zip(sizes, times, strict=True)
    ]
    text = f"{solving[-1] / measuring[-1]:.2f} ×"
    return [
        *rows,
        Row(f"exponent from {sizes[0]} to {sizes[-1]} profiles", "≤ 1.15", f"{slope:.2f}", slope <= 1.15),
        Row("solving / measuring, the largest", "≤ 1 ×", text, bool(solving[-1] <= measuring[-1])),
    ]


def timed(profiles: int) -> tuple[float, float]:
    """Return the processor's time, s, that measuring and solving of so many profiles take."""

    def change(plan: Plan, rng: np.random.Generator) -> None:
        plan.shifts, plan.tilts = profiles // 5, profiles - profiles // 5

    cell = troubled(Trouble("many", change), 1)
    begin = time.process_time()
    observations = [observe_capture(cell.session, c, cell.files.__getitem__) for c in cell.session.captures]
    middle = time.process_time()
    solve_tcp(observations, sphere_of(cell.session.cell, cell.session.captures))
    return middle - begin, time.process_time() - middle
