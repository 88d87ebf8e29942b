"""Keep trained models on disk: run folders, checkpoints, shipped models, and their predictor."""
