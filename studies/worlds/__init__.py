"""Worlds of hidden cases: generators of flights whose missing physical effect only the generator knows. No world shares
code with the simulator, the effects or the lab of quadctl: `blade` is written from the published literature, `borrowed`
flies in simulators of others. A case is a folder of vehicle file, flight logs, and a truth that no command reads."""
