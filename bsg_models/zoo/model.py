"""The interface of all models: an observation in, an expectation out, for any rooms."""

from __future__ import annotations

import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from threading import Lock
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt
from threadpoolctl import ThreadpoolController

from bsg_data.arrays import Bools, Ints
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import CheckpointError, PredictionError
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import RunConfig, find_member
from bsg_models.zoo.settings import DataConfig, EdgeSet, ModelConfig

if TYPE_CHECKING:
    from bsg_data.dataset.dataset import Dataset

_Belief = TypeVar("_Belief", Expectation, CountDistribution)
State = dict[str, npt.NDArray[Any]]  # all that a model has learned, by name


@dataclass(frozen=True, slots=True)
class ModelInputs:
    """What a model can read."""

    classes: int  # C, of the histograms
    vocabulary: tuple[str, ...] = ()  # [V] categories outside the classes
    edges: tuple[EdgeSet, ...] = ("up", "down")


class BeliefModel(ABC):
    """A model of what is hidden. It answers in NumPy, unless it is a network of torch.

    A model is fitted by counting (`fit`), or trained by gradient (`by_gradient`). All that it
    learns is in its state, so one checkpoint format serves all models.

    Attributes:
        by_seed: whether its training depends on a seed; if not, one training shows all.
        config: its settings.
        inputs: what it can read.
        members: of an ensemble, by name.
        origin: the checkpoint that it was restored from; None if it was not restored.
        notes: remarks on its fit for the user, e.g. that it read a sample.
        untaught: `[C]` classes of which no train building had an object: none is expected.
    """

    by_gradient: ClassVar[bool] = False
    by_seed: ClassVar[bool] = True
    origin: str | None = None
    notes: tuple[str, ...] = ()
    untaught: Bools | None = None

    def __init__(self, config: ModelConfig, inputs: ModelInputs) -> None:
        self.config = config
        self.inputs = inputs
        self.members: dict[str, BeliefModel] = {}
        self._held: dict[str, None] = {}  # names of arrays, in their order

    @property
    def vocabulary(self) -> tuple[str, ...]:
        """Categories outside the classes that it reads, `[V]`; its observations need the same."""
        return self.inputs.vocabulary

    @property
    def reads_labels(self) -> bool:
        """Whether it reads room labels, as far as its settings say."""
        return "labels" in getattr(self.config, "reads", ())

    def fit(self, data: Dataset, choice: DataConfig) -> None:  # noqa: B027 - not all learn
        """Learn from the training buildings of a dataset, or set the start of a training."""

    def hold(self, **arrays: npt.ArrayLike) -> None:
        """Keep arrays of float64 as attributes that are part of the state."""
        for name, values in arrays.items():
            self._held[name] = None
            setattr(self, name, np.array(values, dtype=np.float64))

    def state(self) -> State:
        """Return all that it has learned."""
        return {name: getattr(self, name) for name in self._held}

    def load_state(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Take what a model of the same settings has learned.

        If the shape of an array depends on data, a model holds it here first.

        Raises:
            CheckpointError: if an array is missing, unknown or has another shape.
        """
        require_same_shapes(self.state(), state)
        self.hold(**state)

    def expect(self, seen: Observation) -> Expectation:
        """Return the prediction, without gradients, after checking that it is finite.

        A model that does not read the hidden share may expect hidden objects in a searched room;
        `Predictor` sets those to 0.

        Raises:
            PredictionError: naming the checkpoint, if anything is not finite.
        """
        found = self._ask(self.predict, seen)
        if self.untaught is None:
            return found
        return replace(found, hidden_counts=found.hidden_counts.without(self.untaught))

    @abstractmethod
    def predict(self, seen: Observation) -> Expectation:
        """Return the expectation of every node of an observation, of one building or many."""

    def expect_rooms(self, seen: Observation, rows: Ints) -> CountDistribution:
        """Return the hidden counts of some rooms, as `expect` does, but faster.

        Args:
            seen: what was seen.
            rows: `[M]` nodes that are rooms.

        Raises:
            PredictionError: naming the checkpoint, if anything is not finite.
        """
        found = self._ask(self.predict_rooms, seen, rows)
        return found if self.untaught is None else found.without(self.untaught)

    def predict_rooms(self, seen: Observation, rows: Ints) -> CountDistribution:
        """Return the hidden counts of some rooms; arguments as for `expect_rooms`."""
        return self.predict(seen).hidden_counts.take(rows)

    def with_independent_rooms(self) -> BeliefModel:
        """Return it without what makes rooms depend on each other: some are asked faster."""
        return self

    def _ask(self, predict: Callable[..., _Belief], *asked: Any) -> _Belief:
        """Return an answer, computed on one thread, if it is finite.

        Raises:
            PredictionError: naming the checkpoint, if anything is not finite.
        """
        with one_thread():
            belief = predict(*asked)
        if not belief.is_finite:
            raise PredictionError(
                f"{self.origin or type(self).__name__}: the model's answer is not finite (NaN or "
                "infinite); train it again"
            )
        return belief


def make_model(
    config: RunConfig,
    *,
    classes: int,
    vocabulary: tuple[str, ...] = (),
    members: Mapping[str, RunConfig] | None = None,
) -> BeliefModel:
    """Return a new model of a configuration.

    Args:
        config: of the run.
        classes: C, of the histograms.
        vocabulary: categories outside the classes that it may read.
        members: recipes of an ensemble's members; None for those of the zoo.

    Raises:
        ConfigError: if an ensemble names an unknown member.
    """
    reads = vocabulary if config.reads_categories else ()
    inputs = ModelInputs(classes=classes, vocabulary=reads, edges=config.data.edges)
    model: BeliefModel = ZOO[config.model.family].make(config.model, inputs)
    for name in config.members:
        recipe = (members or {}).get(name) or find_member(name)
        model.members[name] = make_model(recipe, classes=classes, vocabulary=vocabulary)
    return model


def require_same_shapes(own: Mapping[str, Any], other: Mapping[str, Any]) -> None:
    """Refuse a state whose arrays are not those of a model, by name and shape."""
    for name in sorted(own.keys() | other.keys()):
        expected, found = (state[name].shape if name in state else "none" for state in (own, other))
        if expected != found:
            raise CheckpointError(f"tensor {name}: expected the shape {expected}, found {found}")


@contextmanager
def one_thread() -> Iterator[None]:
    """Let NumPy, and torch if it is there, compute on one thread.

    So sums do not depend on the number of cores. These networks are too small to gain from more
    threads. They become far slower if other programs use the same cores, as on a robot, because
    each thread waits for the slowest.
    """
    torch: Any = sys.modules.get("torch")
    with _ONE_OF_BLAS:
        if torch is None:
            yield
            return
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            yield
        finally:
            torch.set_num_threads(threads)


class _OneOfBLAS:
    """One thread of BLAS, whose number holds for the process: who leaves last restores it."""

    def __init__(self) -> None:
        self._door, self._inside, self._limits = Lock(), 0, ExitStack()
        self._libraries: ThreadpoolController | None = None  # it takes long to find them

    def __enter__(self) -> None:
        with self._door:
            if not self._inside:
                self._libraries = self._libraries or ThreadpoolController()
                self._limits.enter_context(self._libraries.limit(limits=1, user_api="blas"))
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._door:
            self._inside -= 1
            if not self._inside:
                self._limits.close()


_ONE_OF_BLAS = _OneOfBLAS()
