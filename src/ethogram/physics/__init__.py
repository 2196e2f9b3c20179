"""Physics that worlds are made of: pure functions of state, no agents and no rewards."""
