"""State spaces: the markings that a net reaches, found and held in different ways behind one interface."""
