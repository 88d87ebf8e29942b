"""Published class maps: data files only; `bsg_data.scene.class_map` reads them."""
