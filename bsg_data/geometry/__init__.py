"""What a semantic mesh says: boxes of objects and rooms, storeys, and which rooms adjoin."""
