"""Research: training, experiments, virtual rooms, a second opinion and benchmarks; not in the wheel."""
