"""The dissertation's 157 claims as data, what is measured of them, and their verdicts.

`data/a.toml` to `data/d.toml` hold one investigation each:

    preset      what every side starts from
    ignored     sections of a configuration that say nothing here (other learners')
    worlds      which world plays the physics ("mujoco") and the dissertation's own
                fixed networks ("static-snn"), where there is one
    settings    what every side of this investigation shares
    departures  where the settings are not the dissertation's, or it is silent
    variants    pieces put beside all comparisons of some claims: what they are called
    pieces      name -> settings; a side is a list of names: "left-20 window-150"
    claims      A1, A2, ...: `where` in the dissertation, what it `says`, its `kind`,
                and `cells`, or why it is `untested`; `reading` says how a statement
                without a table is measured

`data/published.json` holds the findings that come with the package (`published`).

Kinds: S a difference with a p value, N no difference, Q read from a figure, R one run
on the real robot, I an interpretation.

A cell compares two sides: `a`, `b`, `says` (">" a is better or more, "<" the other way
round, "=" no difference, "?" a difference without a stated direction), `p` as printed,
and `measure` (of both, or `measure` of a and `measure_b` of b; by default the cost
after the damage). Or it holds one side against a number: `at_most` or `at_least`. With
`variant` it stands beside the claim and counts for nothing in its verdict.

The text of the dissertation that we have has no page numbers: `where` is its section,
table and figure.
"""
