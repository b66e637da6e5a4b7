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
        "which a few failing runs dominate. " + BAND
    ),
    "solved": (
        "Left: objectives reached in order, of {goals}. Right: share of runs whose "
        "trial reached them all. " + BAND
    ),
    "waits": (
        "Share of runs that had solved the task before the damage (left), and, "
        "counted from the first damaged trial, that had solved it again (right). A "
        "curve that ends below 100 % tells of runs that never did. The dotted line "
        "drops from the median."
    ),
    "snn_error": (
        "How wrong the SNN was about each trial before it was trained on it, per "
        "command and output. It falls while the SNN learns the robot and jumps when "
        "the robot changes. " + BAND
    ),
    "displacement": (
        "Each dot is one command: the motion the SNN foresaw against the motion that "
        "came. On the diagonal the SNN is right; a cloud off the diagonal shows what "
        "the damage changed, and the dots of the last trials whether it was learned. "
        "Dots beyond the frame are drawn at its edge."
    ),
    "diversity": (
        "How different the controllers in the population are, by the three measures "
        "of the dissertation; the narrower, the less evolution has to choose from. "
        + BAND
    ),
}

LIGHT = {
    "path": (
        "One run, chosen as the typical one. Solid: where the robot went. Dashed: "
        "where its simulator networks (SNN) had said it would go. The disc has the "
        "radius at which the robot is to circle the lamp. Jumps of the heading are "
        "where the robot was turned at the board's edge."
    ),
    "fitness": (
        "Cost of the controller tried in each trial (equation 5.2 with its sign "
        "turned), lower is better, on a logarithmic axis: the distance from the goal "
        "radius, summed over the cycles, over the distance of the start. The dotted "
        "line is the mean. " + BAND
    ),
    "solved": (
        "Left: whether the robot came to the goal radius. Right: share of runs whose "
        "trial ended with the robot circling the lamp. " + BAND
    ),
    "snn_error": (
        "How wrong the motion SNN was about each trial before it was trained on it, "
        "per cycle and output. " + BAND
    ),
    "sensor_error": (
        "How wrong the two sensor SNNs were about each trial before they were trained "
        "on it, per reading. A part of it is the sensors' own noise. " + BAND
    ),
    "readings": (
        "What the two virtual light sensors read in the trials shown (smaller is "
        "brighter), and what the SNNs had said they would read."
    ),
    "starts": (
        "The last trials of the same run, each from its own random start (dots); "
        "crosses: stopped at the lamp's safety boundary."
    ),
}
"""Where light following reads otherwise than navigation."""

WALK = {
    "path": (
        "One run, chosen as the typical one. Solid: where the robot went, command by "
        "command. Dashed: where its simulator network (SNN) had said it would go. An "
        "adequate gait gets out of the disc."
    ),
    "fitness": (
        "Distance from start to end of the controller tried in each trial, higher is "
        "better; the dotted line is an adequate gait ({adequate:g} m). The fitness "
        "stored is its square with the sign turned (equation 7.4). " + BAND
    ),
    "solved": (
        "Left: whether the gait was adequate ({adequate:g} m). Right: share of runs "
        "whose trial was. " + BAND
    ),
    "waits": (
        "Share of runs that had found an adequate gait before the damage (left), and, "
        "counted from the first damaged trial, again (right). A curve that ends below "
        "100 % tells of runs that never did. The dotted line drops from the median."
    ),
}
"""Where walking reads otherwise than navigation."""

TITLES = {
    "sensor_error": "Error of the sensor networks",
    "readings": "What the light sensors read",
    "starts": "Paths by start",
    "path": "Where the robot went",
    "fitness": "Fitness",
    "solved": "Objectives reached",
    "waits": "Trials needed",
    "snn_error": "Error of the simulator network",
    "displacement": "Foreseen against real motion",
    "diversity": "Diversity of the population",
}
