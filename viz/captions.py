"""How to read each figure of a report."""

BAND = (
    "The line is the median over runs, the band holds the middle half of them; "
    "the dashed orange line marks the onset of damage."
)

CAPTIONS = {
    "path": (
        "One run, chosen as the typical one. Solid: where the robot went. Dashed: "
        "where its simulator network (SNN) had said it would go. Discs are the "
        "objectives, reached in the order {order}; within their radius counts as "
        "reached; what follows the last one is faint. Paths are cut at the board's "
        "edge. Where solid and dashed part, the SNN is wrong about the robot."
    ),
    "fitness": (
        "Cost of the controller tried in each trial, lower is better, on a "
        "logarithmic axis: each objective missed costs {penalty:g}, so the curve "
        "falls in steps as more objectives are reached. The dotted line is the mean, "
        "which a few failing runs dominate. {band}"
    ),
    "solved": (
        "Left: objectives reached in order, of {goals}. Right: share of runs whose "
        "trial reached them all. {band}"
    ),
    "waits": (
        "Share of runs that had solved the task before the damage (left), and, "
        "counted from the first damaged trial, that had solved it again (right). A "
        "curve that ends below 100 % tells of runs that never did. The dotted line "
        "drops from the median."
    ),
    "displacement": (
        "Each dot is one command: the motion the SNN foresaw against the motion that "
        "came. On the diagonal the SNN is right; a cloud off the diagonal shows what "
        "the damage changed, and the dots of the last trials whether it was learned. "
        "Dots beyond the frame are drawn at its edge."
    ),
}

TITLES = {
    "readings": "What the light sensors read",
    "starts": "Paths by start",
    "path": "Where the robot went",
    "fitness": "Fitness",
    "solved": "Objectives reached",
    "waits": "Trials needed",
    "displacement": "Foreseen against real motion",
}
