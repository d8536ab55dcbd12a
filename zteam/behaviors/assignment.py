"""Which robot takes which place, so that the sum of costs is least (the Hungarian algorithm)."""

import math
from collections.abc import Sequence


def assign(costs: Sequence[Sequence[float]]) -> list[int]:
    """The column of each row in the cheapest assignment of a square table of costs.

    The same costs always give the same assignment. It takes n³ steps for n rows.
    """
    count = len(costs)
    row_prices, column_prices = [0.0] * (count + 1), [0.0] * (count + 1)
    # Rows and columns count from 1 here; column 0 holds the row that has no column yet.
    row_of = [0] * (count + 1)
    for row in range(1, count + 1):
        row_of[0] = row
        column, before = _find_free_column(costs, row_prices, column_prices, row_of)
        while column:
            row_of[column] = row_of[before[column]]
            column = before[column]
    columns = [0] * count
    for column, row in enumerate(row_of[1:]):
        columns[row - 1] = column
    return columns


def _find_free_column(
    costs: Sequence[Sequence[float]], row_prices: list[float], column_prices: list[float], row_of: list[int]
) -> tuple[int, list[int]]:
    """The free column at the end of the cheapest chain of changes, and the column before each one in such chains."""
    count = len(costs)
    before, slack, is_used = [0] * (count + 1), [math.inf] * (count + 1), [False] * (count + 1)
    column = 0
    while row_of[column]:
        is_used[column] = True
        row, least, nearest = row_of[column], math.inf, 0
        for other in range(1, count + 1):
            if is_used[other]:
                continue
            cost = costs[row - 1][other - 1] - row_prices[row] - column_prices[other]
            if cost < slack[other]:
                slack[other], before[other] = cost, column
            if slack[other] < least:
                least, nearest = slack[other], other
        for other in range(count + 1):
            if is_used[other]:
                row_prices[row_of[other]] += least
                column_prices[other] -= least
            else:
                slack[other] -= least
        column = nearest
    return column, before
