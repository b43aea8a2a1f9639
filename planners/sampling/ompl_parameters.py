"""Parameters of single OMPL planners, by the names of OMPL's setters."""

from __future__ import annotations

from pydantic import Field

from groundmap.settings import Settings


class OmplParameters(Settings):
    """Parameters that only some of OMPL's planners have.

    A field is named after OMPL's setter (``range`` for ``setRange``). Default: OMPL's own value; a
    planner without the parameter rejects it.
    """

    range: float | None = Field(None, gt=0, le=1e6, description="longest edge of a tree [m]")
    goal_bias: float | None = Field(None, ge=0, le=1, description="share of samples at the goal")
    intermediate_states: bool | None = Field(None, description="also add the states along edges")
    max_nearest_neighbors: int | None = Field(
        None, ge=1, le=10**6, description="neighbours tried for a new state [states]"
    )
    rewire_factor: float | None = Field(
        None, ge=1, le=100, description="factor on the least radius for optimality"
    )
    batch_size: int | None = Field(None, ge=1, le=10**4, description="size of a sorted batch")
    samples_per_batch: int | None = Field(
        None, ge=1, le=10**5, description="size of a batch [states]"
    )
    num_samples: int | None = Field(
        None, ge=1, le=10**6, description="number of samples; default: 1000, then doubled"
    )
    num_sampling_attempts: int | None = Field(None, ge=1, le=10**4, description="tries per sample")
    radius_multiplier: float | None = Field(
        None, ge=1, le=5, description="factor on the least radius for optimality"
    )
    free_space_volume: float | None = Field(
        None, gt=0, description="upper bound of the free volume [m²; in se2 m² rad]"
    )
    border_fraction: float | None = Field(
        None, gt=0, le=1, description="share of expansions from the outer cells"
    )
    min_valid_path_fraction: float | None = Field(
        None, gt=0, le=1, description="least valid share of a motion that is kept"
    )
    failed_expansion_cell_score_factor: float | None = Field(
        None, gt=0, le=1, description="factor on a cell's score after a failure"
    )
    prune_threshold: float | None = Field(
        None, ge=0, le=1, description="relative improvement that triggers pruning"
    )
    prune_threshold_fraction: float | None = Field(
        None, ge=0, le=1, description="relative improvement that triggers pruning"
    )
    delay_cc: bool | None = Field(None, description="check edges in the order of their costs")
    tree_pruning: bool | None = Field(None, description="drop states that can't improve a route")
    pruning: bool | None = Field(None, description="drop states that can't improve a route")
    pruned_measure: bool | None = Field(None, description="neighbourhoods by the pruned volume")
    informed_sampling: bool | None = Field(None, description="sample where a route may improve")
    sample_rejection: bool | None = Field(None, description="informed sampling by rejection")
    new_state_rejection: bool | None = Field(None, description="reject states that can't help")
    admissible_cost_to_come: bool | None = Field(None, description="bound costs by straight lines")
    focus_search: bool | None = Field(None, description="all options that narrow the search")
    k_nearest: bool | None = Field(None, description="choose neighbours by number")
    use_k_nearest: bool | None = Field(None, description="choose neighbours by number")
    nearest_k: bool | None = Field(None, description="choose neighbours by number")
    strict_queue_ordering: bool | None = Field(None, description="keep the queue sorted")
    delay_rewiring_until_initial_solution: bool | None = Field(None, description="rewire later")
    just_in_time_sampling: bool | None = Field(None, description="sample where needed next")
    drop_samples_on_prune: bool | None = Field(None, description="discard samples when pruning")
    stop_on_soln_improvement: bool | None = Field(None, description="stop at each improvement")
    cache_cc: bool | None = Field(None, description="cache the checks of edges")
    heuristics: bool | None = Field(None, description="order the search by a heuristic")
    extended_fmt: bool | None = Field(None, description="add samples where required")

    def parameters(self) -> dict[str, float]:
        """Return the parameters that are set, by name."""
        return self.model_dump(include=set(PARAMETERS), exclude_none=True)


PARAMETERS = tuple(OmplParameters.model_fields)


def setter_of(name: str) -> str:
    """Return the name of OMPL's setter of a parameter.

    Examples
    --------
    >>> setter_of("goal_bias"), setter_of("delay_cc"), setter_of("extended_fmt")
    ('setGoalBias', 'setDelayCC', 'setExtendedFMT')
    """
    words = [word.upper() if word in ("cc", "fmt") else word.title() for word in name.split("_")]
    return f"set{''.join(words)}"
