"""The levels of a study: people over recordings, one device under all of them.

Coordinates x_r of recording r, D of them, H of the hand and the others of the device:

    x_r = A_r beta + E v_u(r) + t_r,    v_u ~ N(0, Sigma),    t_r ~ N(0, T),

beta holds the mean hand and the device (once a configuration), v_u is how the hand of the person u
differs from the mean hand, and T is diagonal: the spread of the device between recordings, and of
one person between trials.  With Gaussian likelihoods everything but Sigma and T is integrated in
closed form; the Gaussian factors are those of D. W. Hogg, A. D. Myers, J. Bovy, "Inferring the
eccentricity distribution", Astrophysical Journal 725 (2010), with integrals instead of sums over
draws, because the device is known far better from all recordings than from any one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from bayeshaptic.inference.population.gaussian_likelihood import GaussianLikelihood, Stacked
from bayeshaptic.inference.population.hyperparameters import Hyperparameters, Unknowns
from bayeshaptic.types import Floats, Ints

_SCATTER = (0.05, 1.0)  # of hands, that a first guess stays within


@dataclass(frozen=True)
class Hierarchy(Stacked):
    """The recordings of a study, described, and how they share their parameters.

    Attributes
    ----------
    likelihoods : tuple of GaussianLikelihood
        R of them.
    user : ndarray of int, shape (R,)
        Who held the device, 0 .. U - 1.
    place : ndarray of int, shape (R,)
        In which configuration, 0 .. C - 1.
    hand, device : ndarray of int, shape (H,), (D - H,)
        Which coordinates are the hand's and which are the device's.
    prior_mean, prior_sd : ndarray, shape (D,)
        Of the mean hand and of the device, in the coordinates of the study.
    """

    likelihoods: Sequence[GaussianLikelihood] = field(repr=False)
    user: Ints
    place: Ints
    hand: Ints
    device: Ints
    prior_mean: Floats
    prior_sd: Floats

    @cached_property
    def layout(self) -> Unknowns:
        """Where each hyperparameter stands in phi, Q of them."""
        repeated = len(self.user) > len(np.unique(self.user))
        return Unknowns(len(self.hand), len(self.device), repeated)

    @cached_property
    def design(self) -> Floats:
        """A_r: which entries of beta the coordinates of a recording are; shape (R, D, q)."""
        hand, device = len(self.hand), len(self.device)
        places = int(self.place.max()) + 1
        design = np.zeros((len(self.user), hand + device, hand + places * device))
        design[:, self.hand, np.arange(hand)] = 1.0
        for r, place in enumerate(self.place):
            design[r, self.device, hand + place * device + np.arange(device)] = 1.0
        return design

    @cached_property
    def entry(self) -> Ints:
        """Which entry of beta each coordinate of a recording is; shape (R, D)."""
        return self.design.argmax(axis=2)

    @cached_property
    def beta_sd(self) -> Floats:
        """Prior standard deviation of beta, whose mean is the origin; shape (q,)."""
        places = int(self.place.max()) + 1
        return np.concatenate([self.prior_sd[self.hand], *[self.prior_sd[self.device]] * places])

    def guess(self) -> tuple[Floats, Floats]:
        """Middle and width of phi by the scatter of the recordings' own estimates; (Q,) each."""
        seen = self.mean[:, self.hand].std(axis=0)
        return self.layout.guess(np.clip(seen, *_SCATTER))

    def spread(self, level: Hyperparameters) -> Floats:
        """Diagonal of T for each of B hyperparameters: between trials, or recordings; (B, D)."""
        spread = np.empty((len(level.trial_sd), len(self.prior_mean)))
        spread[:, self.hand] = level.trial_sd[:, None] ** 2
        spread[:, self.device] = level.device_sd**2
        return spread

    def weight(self, spread: Floats) -> Floats:
        """Inverses of V_r + T for spreads of shape (B, D); shape (B, R, D, D)."""
        marginal = self.covariance + spread[:, None, :, None] * np.eye(spread.shape[1])
        return inverse_and_log_det(marginal)[0]

    def log_density(self, phi: Floats) -> Floats:
        """Log posterior density of hyperparameters phi of shape (B, Q), up to a constant."""
        value = np.full(len(phi), -np.inf)
        sane = self.layout.sane(phi)
        if sane.any():
            value[sane] = self.given(phi[sane]).log_density
        return value

    def expected(self, phi: Floats) -> tuple[Floats, Floats]:
        """Mean and covariance of every recording's coordinates, given all recordings.

        Parameters
        ----------
        phi : ndarray, shape (Q,)
            One vector of hyperparameters.

        Returns
        -------
        mean, covariance : ndarray, shape (R, D), (R, D, D)
        """
        given = self.given(phi[None])
        spread, weight = given.spread[0], self.weight(given.spread)[0]
        means, covariances = [], []
        for r, seen in enumerate(self.mean):
            mean, covariance = (part[0] for part in self.before(given, r))
            gain = spread[:, None] * weight[r]
            kept = np.eye(len(spread)) - gain
            means.append(mean + gain @ (seen - mean))
            covariances.append(kept @ covariance @ kept.T + kept * spread)
        return np.stack(means) + self.prior_mean, np.stack(covariances)

    def before(self, given: Conditionals, r: int) -> tuple[Floats, Floats]:
        """Where the levels above recording `r` put it: A_r beta + E v_u, without t_r.

        Parameters
        ----------
        given : Conditionals
            Of B hyperparameters.
        r : int
            Index of the recording.

        Returns
        -------
        mean, covariance : ndarray, shape (B, D), (B, D, D)
            The mean is less the prior's.
        """
        own = given.own_covariance[:, self.user[r]]
        slope = np.tile(self.design[r], (len(own), 1, 1))
        slope[:, self.hand] -= given.gain[:, self.user[r]]
        mean = np.einsum("bdq,bq->bd", slope, given.beta)
        mean[:, self.hand] += np.einsum("bij,bj->bi", own, given.own_score[:, self.user[r]])
        covariance = slope @ np.linalg.solve(given.precision, slope.transpose(0, 2, 1))
        covariance[:, self.hand[:, None], self.hand] += own
        return mean, covariance

    def _summed(self, spread: Floats, people: int) -> list[Floats]:
        """What recordings say with spreads of shape (B, D): see `positive_kernel.summed`."""
        from bayeshaptic.inference.population.positive_kernel import LANES, summed

        count = len(spread)
        rows = np.minimum(np.arange(-(-count // LANES) * LANES), count - 1)  # the last may be short
        lanes = spread[rows].reshape(-1, LANES, spread.shape[1]).transpose(0, 2, 1)
        recordings = self.covariance, self.mean, np.ascontiguousarray(lanes), self.entry
        found = summed(*recordings, self.user, self.hand, people, self.design.shape[2])
        out = [np.moveaxis(x, -1, 1).reshape(-1, *x.shape[1:-1])[:count] for x in found]
        if np.isnan(out[3]).any():
            raise np.linalg.LinAlgError("Matrix is not positive definite")
        return out

    def given(self, phi: Floats) -> Conditionals:
        """Everything below given hyperparameters, integrated in closed form.

        Parameters
        ----------
        phi : ndarray, shape (B, Q)

        Returns
        -------
        Conditionals
        """
        level = self.layout.read(phi)
        spread = self.spread(level)
        count, people, hand = len(phi), int(self.user.max()) + 1, len(self.hand)
        precision, score, chi, log_det, own, own_score, own_seen = self._summed(spread, people)
        # People: v_u has precision K_u and, given beta, the mean K_u^-1 (score_u - seen_u beta).
        own += level.precision[:, None]
        own_covariance, own_log_dets = inverse_and_log_det(own)
        gain = own_covariance @ own_seen
        gains = gain.reshape(count, people * hand, -1).transpose(0, 2, 1)
        precision -= gains @ own_seen.reshape(count, people * hand, -1)
        score -= (gains @ own_score.reshape(count, -1, 1))[..., 0]
        chi -= np.sum(own_score * (own_covariance @ own_score[..., None])[..., 0], axis=(1, 2))
        precision += np.diag(1 / self.beta_sd**2)
        beta = np.asarray(np.linalg.solve(precision, score[..., None])[..., 0], np.float64)
        root_diagonal = np.diagonal(level.correlation_root, axis1=1, axis2=2) * level.hand_sd
        log_det += 2 * people * np.log(root_diagonal).sum(axis=1)
        log_det += own_log_dets.sum(axis=1) + np.linalg.slogdet(precision)[1]
        value = level.log_prior - 0.5 * (log_det + chi - np.sum(score * beta, axis=1))
        return Conditionals(level, spread, precision, beta, own_covariance, own_score, gain, value)


@dataclass(frozen=True)
class Conditionals:
    """What the recordings say below given hyperparameters, B of them.

    Attributes
    ----------
    level : Hyperparameters
        The hyperparameters by name.
    spread : ndarray, shape (B, D)
        Diagonal of T.
    precision, beta : ndarray, shape (B, q, q), (B, q)
        Of beta, whose prior mean is the origin: precision and mean.
    own_covariance, own_score, gain : ndarray, shape (B, U, H, H), (B, U, H), (B, U, H, q)
        Of v_u given beta: the mean is own_covariance own_score - gain beta.
    log_density : ndarray, shape (B,)
        Log posterior density of the hyperparameters, up to a constant.
    """

    level: Hyperparameters
    spread: Floats
    precision: Floats
    beta: Floats
    own_covariance: Floats
    own_score: Floats
    gain: Floats
    log_density: Floats

    def draw_people(self, beta: Floats, rng: np.random.Generator) -> Floats:
        """Draw v_u, how far each person's hand is from the mean hand.

        Parameters
        ----------
        beta : ndarray, shape (B, q)
            Mean hand and device, one vector for each of the B hyperparameters.
        rng : numpy.random.Generator

        Returns
        -------
        ndarray, shape (B, U, H)
        """
        mean = np.einsum("buij,buj->bui", self.own_covariance, self.own_score)
        mean -= np.einsum("buiq,bq->bui", self.gain, beta)
        root = np.linalg.cholesky(self.own_covariance)
        return mean + np.einsum("buij,buj->bui", root, rng.standard_normal(mean.shape))


def inverse_and_log_det(matrices: Floats) -> tuple[Floats, Floats]:
    """Inverses, (..., n, n), and log determinants, (...), of positive definite matrices.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where one is not positive definite.
    """
    from bayeshaptic.inference.population.positive_kernel import inverses

    found, log_det = inverses(np.ascontiguousarray(matrices.reshape(-1, *matrices.shape[-2:])))
    if np.isnan(log_det).any():
        raise np.linalg.LinAlgError("Matrix is not positive definite")
    return found.reshape(matrices.shape), log_det.reshape(matrices.shape[:-2])
