"""One thin module a command: parse, call, print. `register(app)` adds it; `planner.cli.COMMANDS` lists it."""
