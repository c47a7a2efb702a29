"""Worlds of hidden cases: generators of flights whose missing physical effect only the generator knows. Each world is
written from the published literature in its own code, shares nothing with the simulator or the effects of quadctl, and
writes folders of vehicle file, flight logs and a truth that no command of quadctl reads."""
