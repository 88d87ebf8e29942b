"""Published class maps: data files only; `bsg_data.class_map` reads them."""
