"""Coefficients of the series over aliases, with the formulas of `../alias_tables.py`.

Kernels elsewhere contain it: they are to be compiled anew where it is changed.
"""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats


@kernel(inline=True)
def alias_matrix(late: float, far: bool, bernoulli: Floats, binomials: Floats, out: Floats) -> None:
    """From h_q T^q to the coefficients A_p, split, for a delay of `late` periods; (q, 2 n).

    `far` leaves the terms k = 1 and -1 out.
    """
    sums = np.zeros((2, bernoulli.shape[2]))  # B_n(late) / n!, even n and odd ones
    power = 1.0
    for k in range(len(bernoulli)):
        for part in range(2):
            for n in range(sums.shape[1]):
                sums[part, n] += power * bernoulli[k, part, n]
        power *= late
    if far:
        size = 1.0
        for n in range(1, 2 * sums.shape[1]):
            size /= 2 * math.pi
            turned = math.cos(2 * math.pi * late - 0.5 * math.pi * n)
            sums[n % 2, n // 2] += 2 * turned * size
    half = binomials.shape[2]
    for q in range(len(out)):
        for part in range(2):
            n = part + q + 1  # of the lowest power, p = part
            for i in range(half):
                out[q, part * half + i] = binomials[q, part, i] * sums[n % 2, n // 2 + i]


@kernel(inline=True)
def combine(matrix: Floats, series: Floats, first: int, last: int, out: Floats) -> None:
    """Coefficients of the alias series: those in 1/s times the matrix, a row for each."""
    (terms, count), fours = matrix.shape, 4 * (len(matrix) // 4)
    for row in range(first, last):
        here, h = row - first, series[row]
        for p in range(count):
            out[here, p] = 0.0
        for q in range(0, fours, 4):  # four at a time: what they add up is read and written once
            for p in range(count):
                low = h[q] * matrix[q, p] + h[q + 1] * matrix[q + 1, p]
                high = h[q + 2] * matrix[q + 2, p] + h[q + 3] * matrix[q + 3, p]
                out[here, p] += low + high
        for q in range(fours, terms):
            for p in range(count):
                out[here, p] += h[q] * matrix[q, p]


@kernel(inline=True)
def economise(tails: Floats, economy: Floats, rows: int) -> None:
    """What stands for the higher powers of z added to the lower ones, as `alias_tables` has it."""
    higher, lower = economy.shape
    for row in range(rows):
        for part in range(2):
            first = part * (lower + higher)
            for k in range(higher):
                power = tails[row, first + lower + k]
                for i in range(lower):
                    tails[row, first + i] += power * economy[k, i]
