"""Other packages that do what our worlds and learners do, set up to do the same work."""
