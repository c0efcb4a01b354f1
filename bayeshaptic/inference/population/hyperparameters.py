"""What is inferred of a population: spreads, correlations, and the priors over them.

All of them are real numbers in a vector phi: logarithms of spreads, and partial correlations
through the hyperbolic arc tangent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.types import Floats

HAND_SPREAD = 0.7  # scale of the half-normal prior of the log standard deviation over people
LKJ = 2.0  # shape of the prior of the correlations: 1 is flat, more is closer to none
DEVICE_SPREAD = 0.003  # median of the prior of the device's spread between recordings
DEVICE_SPREAD_FACTOR = 1.5  # its log standard deviation: from 0.02 % to 6 % in two of them
TRIAL_SPREAD = 0.1  # scale of the half-normal prior of one person's spread between trials


@dataclass(frozen=True)
class Hyperparameters:
    """The values that vectors phi of shape (B, Q) stand for.

    Attributes
    ----------
    hand_sd : ndarray, shape (B, H)
        Standard deviation of each of the hand's parameters over people, of its logarithm.
    correlation_root : ndarray, shape (B, H, H)
        Lower Cholesky factor of the correlation over people.
    device_sd : ndarray, shape (B, D - H)
        Standard deviation between recordings of one device, in the coordinates of the study.
    trial_sd : ndarray, shape (B,)
        Standard deviation between recordings of one person's hand, the same for all parameters; 0
        where nobody has two.
    log_prior : ndarray, shape (B,)
        Log prior density of phi, up to a constant.
    """

    hand_sd: Floats
    correlation_root: Floats
    device_sd: Floats
    trial_sd: Floats
    log_prior: Floats

    @property
    def precision(self) -> Floats:
        """Inverse of the covariance over people, shape (B, H, H)."""
        inverse = np.linalg.inv(self.hand_sd[:, :, None] * self.correlation_root)
        return inverse.transpose(0, 2, 1) @ inverse


@dataclass(frozen=True)
class Unknowns:
    """Where the hyperparameters stand in phi.

    Attributes
    ----------
    hand, device : int
        Number of parameters of the hand and of the device.
    trials : bool
        Whether some person was recorded more than once.
    """

    hand: int
    device: int
    trials: bool

    @property
    def pairs(self) -> int:
        """Number of correlations between the hand's parameters."""
        return self.hand * (self.hand - 1) // 2

    @property
    def size(self) -> int:
        """Q, the number of hyperparameters."""
        return self.hand + self.pairs + self.device + self.trials

    def sane(self, phi: Floats) -> NDArray[np.bool_]:
        """Which vectors phi of shape (B, Q) stand for covariances that can be inverted; (B,)."""
        partial = np.zeros(self.size, bool)
        partial[self.hand : self.hand + self.pairs] = True
        return np.all(
            (phi < np.where(partial, 5.0, 3.0)) & (phi > np.where(partial, -5.0, -16.0)), axis=1
        )

    def read(self, phi: Floats) -> Hyperparameters:
        """The hyperparameters by name, with their log prior, of vectors phi of shape (B, Q)."""
        ends = np.cumsum([self.hand, self.pairs, self.device])
        log_hand, partial, log_device, log_trial = np.split(phi, ends, axis=1)
        hand, device = np.exp(log_hand), np.exp(log_device)
        root, log_prior = _correlation(partial, self.hand)
        log_prior += _half_normal(hand, HAND_SPREAD)
        off = (log_device - np.log(DEVICE_SPREAD)) / DEVICE_SPREAD_FACTOR
        log_prior -= 0.5 * np.sum(off**2, axis=1)
        trial = np.zeros(len(phi))
        if self.trials:
            trial = np.exp(log_trial[:, 0])
            log_prior += _half_normal(trial[:, None], TRIAL_SPREAD)
        return Hyperparameters(hand, root, device, trial, log_prior)

    def guess(self, hand_sd: Floats) -> tuple[Floats, Floats]:
        """Where to begin with phi.

        Parameters
        ----------
        hand_sd : ndarray, shape (H,)
            How far people seem to differ, of logarithms.

        Returns
        -------
        middle, width : ndarray, shape (Q,)
        """
        ends = [self.hand, self.pairs, self.device, int(self.trials)]
        ones = [np.zeros(self.pairs), np.full(self.device, -6.5), np.full(1, -3.5)]
        middle: list[Floats] = [np.log(hand_sd), *ones]
        width = [0.3, 0.35, 1.2, 0.8]
        return (
            np.concatenate([m[:count] for m, count in zip(middle, ends, strict=True)]),
            np.concatenate([np.full(count, w) for w, count in zip(width, ends, strict=True)]),
        )


def _half_normal(sd: Floats, scale: float) -> Floats:
    """Log density of log(sd), summed over columns, where sd is half-normal with `scale`."""
    return np.sum(np.log(sd) - 0.5 * (sd / scale) ** 2, axis=1)


def _correlation(partial: Floats, size: int) -> tuple[Floats, Floats]:
    """Cholesky factors of correlations, and their log prior, from unbounded partial correlations.

    D. Lewandowski, D. Kurowicka, H. Joe, "Generating random correlation matrices based on vines and
    extended onion method", Journal of Multivariate Analysis 100 (2009): in a density det(C)^(LKJ -
    1) the partial correlations are independent beta variables.

    Parameters
    ----------
    partial : ndarray, shape (B, H (H - 1) / 2)
        Inverse hyperbolic tangents, row after row of the lower triangle.
    size : int
        H.

    Returns
    -------
    root : ndarray, shape (B, H, H)
        Lower Cholesky factors.
    log_prior : ndarray, shape (B,)
        Up to a constant; the Jacobian of the hyperbolic tangent is in it.
    """
    root = np.zeros((len(partial), size, size))
    root[:, 0, 0] = 1.0
    log_prior = np.zeros(len(partial))
    column = 0
    for i in range(1, size):
        left = np.ones(len(partial))
        for j in range(i):
            z = partial[:, column]
            root[:, i, j] = np.tanh(z) * np.sqrt(left)
            # 1 - tanh^2 without cancellation
            log_rest = 2 * (np.log(2) - np.logaddexp(z, -z))
            left = left * np.exp(log_rest)
            log_prior += (LKJ + 0.5 * (size - 2 - j)) * log_rest
            column += 1
        root[:, i, i] = np.sqrt(left)
    return root, log_prior
