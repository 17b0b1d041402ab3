"""The record that comes along, by formula: modulated noise of a limited band on an uneven baseline.

a(t) = A e(t) sum_j K(f_j) cos(2 pi f_j t + p_j) / norm + b(t), at t = 0, 0.01, ... 9.99 s, with the envelope
e = (t/2.5)^2 exp(2 (1 - t/2.5)), frequencies f_j every 0.1 Hz, the spectrum of Kanai and Tajimi K with ground frequency fg and
damping 0.6, and phases p_j of a linear congruential generator. norm makes the largest value without baseline A.

`python tests/synthetic_record.py` writes both files into scenarios/.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent.parent / "scenarios"
STEP, COUNT = 0.01, 1000


def noise(seed: int, peak: float, lowest: float, highest: float, ground: float) -> np.ndarray:
    """The motion without its baseline, in the unit of `peak`; lowest, highest, ground: frequencies [Hz]."""
    time = STEP * np.arange(COUNT)
    total = np.zeros(COUNT)
    state = seed
    for j in range(round((highest - lowest) / 0.1) + 1):
        state = (1103515245 * state + 12345) % 2**31
        frequency = lowest + 0.1 * j
        ratio = (frequency / ground) ** 2
        weight = np.sqrt((1.0 + 1.44 * ratio) / ((1.0 - ratio) ** 2 + 1.44 * ratio))
        total += weight * np.cos(2.0 * np.pi * (frequency * time + state / 2**31))
    total *= (time / 2.5) ** 2 * np.exp(2.0 * (1.0 - time / 2.5))
    return peak * total / np.abs(total).max()


def horizontal() -> str:
    """PEER AT2, in g: 0.2 g, 0.5 to 8 Hz; the baseline is off by 3 mg, sinks, and jumps by 1 mg at 4 s."""
    time = STEP * np.arange(COUNT)
    values = noise(2010, 0.2, 0.5, 8.0, 2.5) + 0.003 - 0.004 * (time / 10.0) ** 2 + 0.001 * (time > 4.0)
    head = [
        "SYNTHETIC STRONG MOTION RECORD, MODULATED NOISE BY FORMULA",
        "Synthetic, dem-cli, horizontal",
        "ACCELERATION TIME SERIES IN UNITS OF G",
        f"NPTS=  {COUNT:5d}, DT=   {STEP:.4f} SEC",
    ]
    rows = ["".join(f"{v:15.7E}" for v in values[k : k + 5]) for k in range(0, COUNT, 5)]
    return "\n".join([*head, *rows]) + "\n"


def vertical() -> str:
    """CSV, in gal: 100 gal, 1 to 12 Hz; the baseline is off by -2 gal and rises."""
    time = STEP * np.arange(COUNT)
    values = noise(7, 100.0, 1.0, 12.0, 5.0) - 2.0 + 0.3 * time
    head = ["# Synthetic strong motion record, modulated noise by formula: vertical, positive up", "time [s], up [gal]"]
    return "\n".join([*head, *(f"{t:.2f},{a:.4f}" for t, a in zip(time, values, strict=True))]) + "\n"


FILES = {"synthetic-horizontal.at2": horizontal, "synthetic-vertical.csv": vertical}

if __name__ == "__main__":
    for name, make in FILES.items():
        (FOLDER / name).write_text(make(), encoding="utf-8")
