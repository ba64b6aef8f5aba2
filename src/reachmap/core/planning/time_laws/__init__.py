"""Laws by which motions are timed, from exact stops to the optimum."""
