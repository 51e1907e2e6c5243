"""Made worlds: scenes whose truth is known, from drawn label movies to simulated arms."""
