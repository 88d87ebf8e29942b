"""Networks of hidden counts: node features, a trunk, and a prior per room and class.

    k ~ softmax((Q h)_c)         one of K components of class c in a room
    Λ | k ~ Gamma(r, r / m)      its rate; log m = (W h)_kc, log r = (U h)_kc
    V ~ Poisson((1 − f) Λ)       what was seen of it
    H ~ Poisson(f Λ)             what is hidden, so that
    H | V, k ~ NB(mean f (r + V) / (r / m + 1 − f), dispersion r + V)

h is the trunk's encoding of a node's features, and f the share that the node hides. This is
shrinkage per class (`bsg_models.zoo.gamma_poisson`) with a separate prior for every room. h knows
V, so the components' weights are those after V. Two components say what one cannot: many or none.
The network predicts the usual count in such a room, and how sure that is. Bayes' rule then adds the
seen objects of the class itself, at any share. So the node's own histogram need not pass through
the trunk.

The prior of the first true counts is tilted (`bsg_models.belief.negative_binomial`) by factors that
are also linear in h: rooms have one refrigerator, not two. Common sense about the room's label
tilts the count 0 (`bsg_models.zoo.features`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Counts, Ints
from bsg_data.errors import MismatchError
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_models.arrays import Array, doubles, library_of
from bsg_models.belief.count_distribution import MIN_RATE, CountDistribution
from bsg_models.belief.negative_binomial import hidden_posterior, hidden_tilts
from bsg_models.inputs.folds import scenes_of
from bsg_models.inputs.nodes import Neighbours, Nodes, to_nodes
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.features import (
    EVERYTHING,
    LabelPrior,
    NetworkConfig,
    NodeFeatures,
    tabulate_labels,
)
from bsg_models.zoo.layers import (
    NO_DROPOUT,
    NoDropout,
    Weight,
    Weights,
    linear,
    linear_weights,
    log_softmax,
    norm,
    norm_weights,
    silu,
)
from bsg_models.zoo.model import ModelInputs, State, require_same_shapes
from bsg_models.zoo.settings import DataConfig, TrainingConfig

if TYPE_CHECKING:
    from bsg_data.dataset.dataset import Dataset

_MOST = 5.0  # limit of log m and |log r|: e^5 objects of a class in a room; log m ≥ −10


@dataclass(frozen=True, eq=False, slots=True)
class Posterior:
    """The hidden counts as a network gives them, in NumPy or torch: K components of N nodes."""

    mean: Array  # [K, N, C] λ before tilts
    dispersion: Array  # [K, N, C] r
    log_weight: Array  # [K, N, C] logarithm of each component's weight
    tilts: list[Array]  # J of [K, N, C]


class CountNetwork(CalibratedModel):
    """GraphSAGE between building and rooms, then a prior of the counts of every room and class.

    Its trunk is `depth` rounds of h ← h + dropout(SiLU(norm(W₁ mean of the neighbours + W₂ h))).
    The mean is that of GraphSAGE (Hamilton et al., 2017). The residual sum keeps a node's own
    information: without it, rounds of averaging over a star of rooms make the rooms alike.

    It answers in NumPy. `bsg_models.training.count_gradients` trains the same functions in torch.

    Attributes:
        shapes: of the weights, and what they start from.
        weights: float32 arrays by name, all that it learns besides its calibration.
    """

    by_gradient = True
    config: NetworkConfig

    def __init__(self, config: NetworkConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.features = NodeFeatures(config, inputs.classes, len(inputs.vocabulary))
        self.head = PriorHead(config, inputs.classes)
        self.labels = LabelPrior(inputs.classes) if "labels" in self.features.reads else None
        self.shapes: dict[str, Weight] = {
            **self.features.weights,
            **self.head.weights,
            **(self.labels.weights if self.labels else {}),
            **linear_weights("enter.1", self.features.width, config.width),
        }
        for number in range(config.depth):
            self.shapes |= _convolution_weights(f"convolutions.{number}", config.width)
            self.shapes |= norm_weights(f"norms.{number}", config.width)
        self.weights: State = {
            name: np.full(weight.shape, weight.value, dtype=np.float32)
            for name, weight in self.shapes.items()
        }

    def state(self) -> State:
        """Return weights and calibration."""
        return {**super().state(), **self.weights}

    def load_state(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Take weights and calibration."""
        require_same_shapes(self.state(), state)
        self.weights = {name: np.asarray(state[name], np.float32) for name in self.weights}
        self.hold(**{name: state[name] for name in super().state()})

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Start the head from the mean histogram of the training rooms."""
        if self.labels is not None:
            table = tabulate_labels(data.manifest.class_space.classes)
            self.weights["labels.log_odds"] = table.astype(np.float32)
        from bsg_models.zoo.gamma_poisson import tally_rooms  # only trainings come here

        tallies = tally_rooms(data, scenes_of(data, "train", fold=choice.fold))
        means = np.array([values @ times / times.sum() for values, times in tallies])
        apart = np.linspace(-1, 1, self.config.components + 2)[1:-1, None]  # none alike
        start = np.log(means.clip(min=MIN_RATE)) + apart
        self.weights["head.mean.bias"] = start.ravel().astype(np.float32)

    def nodes_of(self, seen: Observation, targets: Counts | None = None) -> Nodes:
        """Return an observation as the arrays that the network reads."""
        if seen.vocabulary != self.vocabulary:
            unclassified = self._find_unclassified(seen)
            seen = replace(seen, vocabulary=self.vocabulary, unclassified=unclassified)
        edges, reads = self.inputs.edges, self.config.reads
        return to_nodes(seen, edges=edges, targets=targets, reads=reads)

    def _find_unclassified(self, seen: Observation) -> Counts:
        """Return no categories for an observation that has none, `[N, V]`."""
        if seen.vocabulary:
            raise MismatchError(
                f"the observation has {len(seen.vocabulary)} categories outside the classes, "
                f"expected the {len(self.vocabulary)} that the model reads; make it with "
                "vocabulary=model.vocabulary"
            )
        return np.zeros((len(seen.inputs), len(self.vocabulary)), dtype=np.int64)

    def forward(
        self,
        weights: Weights,
        nodes: Nodes,
        drop: NoDropout = NO_DROPOUT,
        *,
        rows: Any = slice(None),
    ) -> Posterior:
        """Return the posterior of the hidden counts of N nodes, or some rows, and C classes."""
        nodes = self.features.forget(nodes, drop)
        encoded = self._encode(weights, nodes, drop, rows)
        cells = [nodes.x[rows], nodes.share[rows]]
        if self.labels is not None:  # a room that was seen says more than its label
            label_log_odds = self.labels(weights, nodes.evidence["labels"][rows])
            cells.append(label_log_odds * nodes.hidden_share[rows][:, None])
        return self.head(weights, encoded, *cells, drop=drop)

    def _encode(self, weights: Weights, nodes: Nodes, drop: NoDropout, rows: Any) -> Array:
        """Return some nodes after all rounds, `[M, width]`."""
        dropout = self.config.dropout
        features = self.features(weights, nodes, drop)
        shown = drop.channels(features, dropout / 2, spared=self.features.spared)
        h = silu(linear(weights, "enter.1", shown))
        for number in range(self.config.depth):
            taken = rows if number == self.config.depth - 1 else slice(None)
            heard = convolve(weights, f"convolutions.{number}", h, nodes.neighbours, taken)
            h = h[taken] + drop.channels(silu(norm(weights, f"norms.{number}", heard)), dropout)
        return h

    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        """Return the distribution that the network gives."""
        return to_distribution(self.forward(self.weights, self.nodes_of(seen)))

    def learned_rooms(self, seen: Observation, rows: Ints) -> CountDistribution:
        """Return the uncalibrated hidden counts of some rooms."""
        return to_distribution(self.forward(self.weights, self.nodes_of(seen), rows=rows))


def to_distribution(posterior: Posterior) -> CountDistribution:
    """Return the distribution of a posterior, in double precision."""
    xp = library_of(posterior.mean)
    weight = xp.exp(doubles(posterior.log_weight))
    return CountDistribution(
        doubles(posterior.mean),
        doubles(posterior.dispersion),
        weight / weight.sum(axis=0),
        doubles(xp.stack(posterior.tilts)) if posterior.tilts else None,
    )


class PriorHead:
    """Layers from the encoded nodes to priors of the rates, and to the hidden counts."""

    def __init__(self, config: NetworkConfig, classes: int) -> None:
        self.classes, self.components, self.tilted = classes, config.components, config.tilted
        self.dropout = config.dropout
        out = config.components * classes
        self.weights: dict[str, Weight] = {}
        for name in ("mean", "shape", "weight"):
            self.weights |= linear_weights(f"head.{name}", config.width, out, zero=True)
        if self.tilted:
            out *= self.tilted
            self.weights |= linear_weights("head.tilt", config.width, out, zero=True)

    def __call__(
        self,
        weights: Weights,
        encoded: Array,
        seen: Array,
        share: Array,
        label_log_odds: Array | None = None,
        *,
        drop: NoDropout = NO_DROPOUT,
    ) -> Posterior:
        """Return the posterior of the hidden counts, given what was seen and the share hidden.

        `label_log_odds` adds to the log odds of any; all are `[N, C]`.
        """
        xp = library_of(encoded)

        def read(name: str) -> Array:
            """Return what a layer says of each component, `[K, N, C]`, or `[J · K, N, C]`."""
            outputs = linear(weights, f"head.{name}", drop.channels(encoded, self.dropout))
            return outputs.reshape(outputs.shape[0], -1, self.classes).swapaxes(0, 1)

        mean = xp.exp(read("mean").clip(-2 * _MOST, _MOST))
        shape = xp.exp(read("shape").clip(-_MOST, _MOST))
        log_weight = log_softmax(read("weight"), axis=0)
        hidden = hidden_posterior(shape, shape / mean, seen, share)
        if self.tilted:
            tilts = read("tilt").clip(-_MOST, _MOST).reshape(self.tilted, *mean.shape)
        elif label_log_odds is None:
            return Posterior(*hidden, log_weight, [])
        else:
            tilts = xp.zeros_like(mean)[None]
        if label_log_odds is not None:
            tilts = xp.concatenate([tilts[:1] - label_log_odds, tilts[1:]])
        return Posterior(*hidden, log_weight, hidden_tilts(tilts, seen))


def _convolution_weights(name: str, width: int) -> dict[str, Weight]:
    """Return the weights of `convolve`, by the names that PyG gives them."""
    of_mean = linear_weights(f"{name}.lin_l", width, width)
    return of_mean | linear_weights(f"{name}.lin_r", width, width, bias=False)


def convolve(
    weights: Weights, name: str, x: Array, neighbours: Neighbours, rows: Any = slice(None)
) -> Array:
    """Return W₁ (mean of the neighbours) + W₂ x of all nodes, or some rows, `[N, width]`."""
    mean = neighbours.mean(x, rows)
    return linear(weights, f"{name}.lin_l", mean) + linear(weights, f"{name}.lin_r", x[rows])


# Any observation: every kind of mask in turn, sometimes with withheld classes, as in a search, or
# with a detector of few words.
# Words of fewer buildings mislead: with a coat rack in nine, a hall was taken for a bathroom.
ANY_MASK = DataConfig(
    mask=MaskRecipe(strategy="mixed", withhold=0.05, detector=0.25),
    fractions=(0.1, 0.9),
    edges=("complete",),
    min_scenes=10,
)
_TRAINING = TrainingConfig(
    epochs=160,
    batch_size=32,
    learning_rate=0.002,
    decay=0.02,
    decay_as="decoupled",
    schedule="one-cycle",
    clip=5.0,
    validate_every=20,
)
# Every room sees every other, and the visible share varies: a model then works at any share.
CECI_SAGE = ZooRow(
    NetworkConfig(),
    CountNetwork,
    data=DataConfig(fractions=(0.1, 0.9), edges=("complete",)),
    training=_TRAINING,
)
UNIVERSAL = ZooRow(
    NetworkConfig(reads=EVERYTHING),
    CountNetwork,
    data=ANY_MASK,
    # Of a building that is being found there are more views than of a whole one.
    training=_TRAINING.model_copy(update={"epochs": 280}),
    summary="GraphSAGE for any observation: trained on every kind of mask; reads all evidence.",
)
