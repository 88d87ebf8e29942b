"""Families of models: what each depends on, with the values that it was measured with."""

from __future__ import annotations

from typing import Annotated, Literal, Self, TypeVar

from pydantic import Field, model_validator

from bsg_data.recipes import Record

Likelihood = Literal["mse", "poisson", "negative-binomial"]
TreeReading = Literal["mask", "building", "categories"]
Reading = TreeReading | Literal["withheld"]
T = TypeVar("T", bound=Record)


class InputConfig(Record):
    """Predict that what was seen is all there is."""

    family: Literal["input"] = "input"


class DoubledConfig(Record):
    """Predict input / (1 − f), f the share that a node hides: at one half, twice what was seen."""

    family: Literal["doubled"] = "doubled"


class TrainMeanConfig(Record):
    """Predict the mean histogram of the training rooms, and of the training buildings."""

    family: Literal["train-mean"] = "train-mean"


class GammaPoissonConfig(Record):
    """Shrink each count to its class: Poisson counts with a Gamma prior fitted per class."""

    family: Literal["gamma-poisson"] = "gamma-poisson"


class ConditionalConfig(Record):
    """The paper's equations 1 to 3, by counting on masks of the training rooms.

    Attributes:
        observe: condition on which classes are seen (equation 1), or on how many of each (2, 3).
        smoothing: added to every count, as a share of the class's mean.
        draws: masks of every training building.
    """

    family: Literal["conditional"] = "conditional"
    observe: Literal["classes", "counts"] = "counts"
    smoothing: float = Field(default=2.0, gt=0, allow_inf_nan=False)
    draws: int = Field(default=20, ge=1, le=1000)


class NaiveBayesConfig(Record):
    """Presence of each class from which classes are seen, as if these were independent given it.

    Attributes:
        smoothing: added to every count, as a share of the class's mean.
        draws: masks of every training building.
        temper: exponent on what each class says, since they are not independent.
    """

    family: Literal["naive-bayes"] = "naive-bayes"
    smoothing: float = Field(default=2.0, gt=0, allow_inf_nan=False)
    draws: int = Field(default=20, ge=1, le=1000)
    temper: float = Field(default=0.5, gt=0, le=1)


class MixtureConfig(Record):
    """Latent room types with negative-binomial counts, fitted by expectation maximisation.

    Attributes:
        types: number of room types.
        iterations: of expectation maximisation.
        temper: exponent on the likelihood of what is seen; below 1, since the classes of a room
            are not as independent as a type says.
        building: whether the other rooms of a building tell its types and habits.
        calibrate: fit three numbers on the val buildings that mend how sure the model is.
    """

    family: Literal["mixture"] = "mixture"
    types: int = Field(default=24, ge=1, le=1000)
    iterations: int = Field(default=60, ge=1, le=10_000)
    temper: float = Field(default=0.85, gt=0, le=1)
    building: bool = True
    calibrate: bool = True


class BoostingConfig(Record):
    """Boosted trees with a Poisson loss, one model a class (LightGBM).

    Attributes:
        trees: of each class.
        leaves: of each tree.
        learning_rate: of boosting.
        draws: masks of every training building.
        reads: what it sees besides a room's own histogram; see `NodeFeatures`.
        calibrate: fit three numbers on the val buildings that mend how sure the model is.
    """

    family: Literal["poisson-boosting"] = "poisson-boosting"
    trees: int = Field(default=80, ge=1, le=10_000)
    leaves: int = Field(default=15, ge=2, le=1024)
    learning_rate: float = Field(default=0.06, gt=0, le=1)
    draws: int = Field(default=5, ge=1, le=1000)
    reads: tuple[TreeReading, ...] = ("mask", "building", "categories")
    calibrate: bool = True


class GCNConfig(Record):
    """The paper's CECI: GCNConv layers with batch normalisation, ReLU and dropout.

    Attributes:
        depth: GCNConv layers; the paper has 5.
        width: channels of the hidden layers; the paper does not say.
        dropout: share of channels dropped after each hidden layer; the paper does not say.
        last_layer: what follows the last GCNConv: nothing (`linear`), or what follows the others
            (`block`), which is the paper's sentence read literally.
        likelihood: mean squared error of whole histograms, as in the paper.
    """

    family: Literal["ceci-gcn"] = "ceci-gcn"
    depth: int = Field(default=5, ge=1, le=64)
    width: int = Field(default=64, ge=1, le=4096)
    dropout: float = Field(default=0.5, ge=0.0, lt=1.0)
    last_layer: Literal["linear", "block"] = "linear"
    likelihood: Literal["mse"] = "mse"


class NetworkConfig(Record):
    """What all networks of hidden counts have (`bsg_models.zoo.count_network`).

    Attributes:
        width: channels of the hidden layers.
        depth: rounds or layers.
        dropout: share of channels dropped after each; half of it of the features.
        likelihood: of the hidden counts.
        reads: what a node's features hold besides its own histogram; see `NodeFeatures`.
        embedding: width of the embedding of the categories outside the classes.
        embed: `learned` with all the rest, or `svd`: the first components of which categories are
            in which training rooms, kept as they are.
        category_dropout: share of these categories that training overlooks.
        calibrate: fit three numbers on the val buildings that mend how sure the model is.
    """

    width: int = Field(default=128, ge=1, le=4096)
    depth: int = Field(default=2, ge=1, le=64)
    dropout: float = Field(default=0.4, ge=0.0, lt=1.0)
    likelihood: Likelihood = "negative-binomial"
    reads: tuple[Reading, ...] = ("mask", "building", "categories")
    embedding: int = Field(default=32, ge=1, le=4096)
    embed: Literal["learned", "svd"] = "learned"
    category_dropout: float = Field(default=0.3, ge=0.0, lt=1.0)
    calibrate: bool = True


class ResidualGCNConfig(NetworkConfig):
    """GCNConv layers that keep the node's own histogram and predict what is hidden."""

    family: Literal["ceci-gcn-residual"] = "ceci-gcn-residual"


class SAGEConfig(NetworkConfig):
    """GraphSAGE between building and rooms."""

    family: Literal["ceci-sage"] = "ceci-sage"


class GATConfig(NetworkConfig):
    """Graph attention between building and rooms; `heads` divides `width`."""

    family: Literal["ceci-gat"] = "ceci-gat"
    heads: int = Field(default=4, ge=1)

    @model_validator(mode="after")
    def _heads_divide(self) -> Self:
        return _require_heads(self, self.width, self.heads)


class GINConfig(NetworkConfig):
    """Graph isomorphism network between building and rooms."""

    family: Literal["ceci-gin"] = "ceci-gin"


class DeepSetsConfig(NetworkConfig):
    """Dense layers over a room's features and sums over its building."""

    family: Literal["deepsets"] = "deepsets"


class RoomTransformerConfig(NetworkConfig):
    """Attention of all nodes of a building to each other; `heads` divides `width`."""

    family: Literal["room-transformer"] = "room-transformer"
    heads: int = Field(default=4, ge=1)

    @model_validator(mode="after")
    def _heads_divide(self) -> Self:
        return _require_heads(self, self.width, self.heads)


class EnsembleConfig(Record):
    """Several models of the zoo, whose distributions are mixed in equal parts.

    Attributes:
        members: names of the zoo; each is trained by its own recipe.
        calibrate: fit three numbers on the val buildings that mend how sure the mixture is.
    """

    family: Literal["ensemble"] = "ensemble"
    members: tuple[str, ...] = Field(
        default=("mixture", "ceci-gcn-residual", "ceci-sage", "room-transformer"), min_length=1
    )
    calibrate: bool = True

    @model_validator(mode="after")
    def _members_differ(self) -> Self:
        if len(set(self.members)) < len(self.members):
            raise ValueError(f"members must differ, found {', '.join(self.members)}")
        return self


def _require_heads(config: T, width: int, heads: int) -> T:
    if width % heads:
        raise ValueError(f"width {width} must be a multiple of heads {heads}")
    return config


ModelConfig = Annotated[
    InputConfig
    | DoubledConfig
    | TrainMeanConfig
    | ConditionalConfig
    | GammaPoissonConfig
    | NaiveBayesConfig
    | MixtureConfig
    | BoostingConfig
    | GCNConfig
    | ResidualGCNConfig
    | SAGEConfig
    | GATConfig
    | GINConfig
    | DeepSetsConfig
    | RoomTransformerConfig
    | EnsembleConfig,
    Field(discriminator="family"),
]
