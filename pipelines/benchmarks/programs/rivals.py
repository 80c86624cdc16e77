"""The models that papers put on top of an identified geometry, as programs of a benchmark; `benchmark.py` starts it.

    python pipelines/benchmarks/programs/rivals.py given answers

Each learns the errors that the geometry leaves of the training stations:
- `kriging_of_all_joints`: a Gaussian process with one length for each joint; lengths, nugget and shape of the kernel by marginal likelihood;
- `inverse_distances_in_joint_space` and `inverse_distances_in_space`: the mean of the eight nearest stations, by inverse squared distance;
- `network`: the mean of five small networks.
Separations of joints are chords, `2 sin(Δq/2)`. Needs numpy, scipy and scikit-learn.
"""

import argparse
import warnings
from pathlib import Path

import common
import numpy as np
from scipy.spatial.distance import cdist
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, Matern, WhiteKernel
from sklearn.neural_network import MLPRegressor
from sklearn.preprocessing import StandardScaler
from threadpoolctl import threadpool_limits

# Lengths that the search starts from, rad, and the nugget; stations that the kernel is learnt from at most.
STARTS, NUGGET, LEARNT_FROM = [0.6, 2.0], 0.1, 500
# Logarithms of lengths and nugget stay within this; most steps of the search, and the gain that ends it, nats.
LARGEST_LOGARITHM, STEPS, WORTH = 12.0, 60, 1e-4
NEAREST, POWER, EXACT_HIT = 8, 2, 1e-9
MEMBERS = 5


def circle(joints):
    """Sine and cosine of each joint, beside each other: distances are chords. 1000 mm of a slide, which no angle reaches, count as 1 rad."""
    slides = np.abs(joints).max(0) > 4 * np.pi
    turning = np.stack([np.sin(joints), np.cos(joints)], axis=2)
    sliding = np.stack([joints / 1000, 0 * joints], axis=2)
    return np.where(slides[:, None], sliding, turning).reshape(len(joints), -1)


def likelihood(kernel, places, errors):
    """Minus the marginal likelihood (nats, up to a constant) as a function of the logarithms of lengths and nugget, and its slope; the size of each
    axis is the most likely one. Sine and cosine of a joint have one length."""
    joints = places.shape[1] // 2
    spread = np.zeros((2 * joints + 1, joints + 1))
    spread[:-1, :-1], spread[-1, -1] = np.repeat(np.eye(joints), 2, axis=0), 1

    def value(own):
        matrix, slopes = kernel.clone_with_theta(spread @ own)(places, eval_gradient=True)
        inverse, (_, logarithm) = np.linalg.inv(matrix), np.linalg.slogdet(matrix)
        weights = inverse @ errors
        size = (errors * weights).mean(0)
        by = (weights / size) @ weights.T - 3 * inverse
        cost = 0.5 * (len(errors) * np.log(size).sum() + 3 * logarithm)
        return cost, -0.5 * spread.T @ np.einsum("ij,ijk->k", by, slopes)

    return value, spread


def descended(value, at):
    """The optimum that quasi-Newton steps (Broyden, Fletcher, Goldfarb, Shanno) of at most 1 in each logarithm lead to, with its cost."""
    (cost, slope), inverse = value(at), np.eye(len(at))
    for _ in range(STEPS):
        direction = -inverse @ slope
        longest = 1 / max(1, np.abs(direction).max())
        for share in longest * 0.5 ** np.arange(20):
            step = share * direction
            if np.abs(at + step).max() > LARGEST_LOGARITHM:
                continue
            after, slope_after = value(at + step)
            if after <= cost + 1e-4 * (slope @ step):
                break
        else:
            return cost, at
        change, gain = slope_after - slope, cost - after
        at, cost, slope = at + step, after, slope_after
        if (along := step @ change) > 1e-12:
            left = np.eye(len(at)) - np.outer(step, change) / along
            inverse = left @ inverse @ left.T + np.outer(step, step) / along
        if gain < WORTH:
            break
    return cost, at


def kriging(train, test):
    """Mean and variance along each axis by a Gaussian process."""
    places = circle(train.joints)
    count = min(len(places), LEARNT_FROM)
    learnt = np.arange(count) * len(places) // count
    best = None
    for start in STARTS:
        lengths = np.full(places.shape[1], start)
        for shape in RBF(lengths), Matern(lengths, nu=1.5), Matern(lengths, nu=0.5):
            kernel = shape + WhiteKernel(NUGGET)
            value, spread = likelihood(kernel, places[learnt], train.error[learnt])
            first = np.append(np.log(lengths[::2]), np.log(NUGGET))
            cost, found = descended(value, first)
            if best is None or cost < best[0]:
                best = cost, kernel.clone_with_theta(spread @ found)
    weights = np.linalg.solve(best[1](places), train.error)
    size = np.sqrt((train.error * weights).mean(0))
    own = GaussianProcessRegressor(best[1], optimizer=None).fit(places, train.error / size)
    mean, sd = own.predict(circle(test.joints), return_std=True)
    return mean * size, (sd * size) ** 2


def inverse_distances(known, errors, asked):
    """The mean of the nearest stations; a station does not predict itself where `asked` is `known`."""
    distances = cdist(asked, known)
    if asked is known:
        np.fill_diagonal(distances, np.inf)
    nearest = np.argsort(distances, axis=1)[:, :NEAREST]
    near = np.maximum(np.take_along_axis(distances, nearest, axis=1), EXACT_HIT)
    weights = (near[:, :1] / near) ** POWER
    return np.einsum("ni,nia->na", weights / weights.sum(1, keepdims=True), errors[nearest])


def idw(train, test, places):
    """Mean, and the variance along each axis that other stations leave of each."""
    known, asked = places(train), places(test)
    left = train.error - inverse_distances(known, train.error, known)
    mean = inverse_distances(known, train.error, asked)
    return mean, np.broadcast_to((left**2).mean(0), mean.shape)


def network(train, test):
    """Mean of the members. Every fifth station trains none of them: what they leave there is the variance."""
    scale = StandardScaler().fit(circle(train.joints))
    inputs, asked = scale.transform(circle(train.joints)), scale.transform(circle(test.joints))
    size = np.sqrt((train.error**2).mean(0))
    kept = np.arange(len(inputs)) % 5 == 4
    members = [
        MLPRegressor(hidden_layer_sizes=(32, 32), activation="tanh", alpha=0.1, solver="lbfgs", max_iter=300, random_state=seed)
        .fit(inputs[~kept], train.error[~kept] / size)
        for seed in range(MEMBERS)
    ]
    predicted = lambda of: size * np.mean([own.predict(of) for own in members], axis=0)
    mean = predicted(asked)
    left = train.error[kept] - predicted(inputs[kept])
    return mean, np.broadcast_to((left**2).mean(0), mean.shape)


RIVALS = {
    "kriging_of_all_joints": kriging,
    "inverse_distances_in_joint_space": lambda train, test: idw(train, test, lambda own: circle(own.joints)),
    "inverse_distances_in_space": lambda train, test: idw(train, test, lambda own: own.geometry),
    "network": network,
}


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("given", type=Path)
    arguments.add_argument("answers", type=Path)
    own = arguments.parse_args()
    warnings.simplefilter("ignore", ConvergenceWarning)
    # Matrices are small: threads would wait for each other.
    threadpool_limits(1)
    for folder in common.arms(own.given):
        for split in common.splits(folder):
            train, test = common.stations(split / "train.csv"), common.stations(split / "test.csv")
            for name, rival in RIVALS.items():
                mean, variance = rival(train, test)
                path = own.answers / name / folder.name / f"{split.name}.csv"
                common.answer(path, test.names, test.geometry + mean, variance)


if __name__ == "__main__":
    main()
