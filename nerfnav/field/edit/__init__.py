"""Field editing: move, resample, crop and bake fields without training again."""
