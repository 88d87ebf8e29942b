"""The dataset on disk: schema, manifest, shards, splits, histograms and cards."""
