"""Load and publish models on the Hugging Face hub, with its own mixin; needs the extra `hub`.

A hub model is three files: `model.safetensors`, an unchanged checkpoint;
`config.json`, the same configuration for people; and `README.md`, its card.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

from huggingface_hub import ModelHubMixin

from bsg_data.files import AnyPath, encode_json, write_bytes
from bsg_models.runs.checkpoint_file import read_fields
from bsg_models.runs.found_model import HUB_CARD, HUB_CONFIG, HUB_WEIGHTS, download, find_model
from bsg_models.runs.model_card import LIBRARY, PAPER, TAGS, write_model_card
from bsg_models.runs.predictor import Predictor


class HubModel(
    ModelHubMixin,
    library_name=LIBRARY,
    paper_url=PAPER,
    tags=list(TAGS),
):
    """A trained model in the form of the Hugging Face hub.

    Attributes:
        predictor: the loaded model.

    Examples:
        >>> model = HubModel.from_pretrained("folder")  # doctest: +SKIP
        >>> model.push_to_hub("me/my-rooms")  # doctest: +SKIP
        >>> model.predictor(graph).presence.shape  # doctest: +SKIP
        (15, 45)
    """

    def __init__(self, model: AnyPath) -> None:
        """Load a model: a run, a folder of a hub model, a file, or a shipped model.

        Raises:
            CheckpointError: if there is no such model, or it is damaged.
        """
        self._found = find_model(model)
        self.predictor = Predictor(self._found.path)

    def _save_pretrained(self, save_directory: Path) -> None:
        """Write the three files; the checkpoint is copied byte for byte."""
        fields = read_fields(self._found.path)
        facts = {
            "checkpoint_version": fields["checkpoint_version"],
            "class_space": fields["class_space"],
            "run": fields["config"],
        }
        shutil.copyfile(self._found.path, save_directory / HUB_WEIGHTS)
        write_bytes(save_directory / HUB_CONFIG, (encode_json(facts, indent=1) + "\n").encode())
        write_bytes(save_directory / HUB_CARD, write_model_card(self._found, fields).encode())

    @classmethod
    def from_pretrained(cls, pretrained_model_name_or_path: AnyPath, **options: Any) -> HubModel:
        """Load a model from a local folder, or download it from the hub.

        Args:
            pretrained_model_name_or_path: the folder, or `OWNER/NAME`.
            options: of `hf_hub_download`, such as `revision`, `cache_dir` and `local_files_only`.

        Raises:
            CheckpointError: if there is no such model, it cannot be downloaded, or it is damaged.
        """
        name = os.fspath(pretrained_model_name_or_path)
        return cls(Path(name) if Path(name).is_dir() else download(name, **options))
