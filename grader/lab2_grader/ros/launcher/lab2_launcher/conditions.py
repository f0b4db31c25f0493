"""The conditions of `launch.conditions`."""

from __future__ import annotations

import warnings

from .core import (
    Condition,
    LaunchContext,
    Substitution,
    normalize_to_list_of_substitutions,
    perform_substitutions,
)

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence

    from .core import SomeSubstitutionsType

_TRUTHS = {"true": True, "1": True, "false": False, "0": False}


class InvalidConditionExpressionError(ValueError):
    """A condition is neither true nor false."""

    def __init__(self, expression: str, unexpanded_expression: Sequence[Substitution], valid: Sequence[str]) -> None:
        expanded_from = " + ".join(str(sub) for sub in unexpanded_expression)
        super().__init__(
            f"invalid condition expression, expected one of [{', '.join(valid)}] but got '{expression}', "
            f"expanded from '{expanded_from}'"
        )


def evaluate_condition_expression(context: LaunchContext, expression: Sequence[Substitution]) -> bool:
    """Whether the performed *expression* is true.

    Raises:
        InvalidConditionExpressionError: It is none of true, 1, false, 0.
    """
    text = perform_substitutions(context, expression).strip().lower()
    if text not in _TRUTHS:
        raise InvalidConditionExpressionError(text, expression, list(_TRUTHS))
    return _TRUTHS[text]


class IfCondition(Condition):
    """True when the expression is."""

    def __init__(self, predicate_expression: SomeSubstitutionsType) -> None:
        self._expression = normalize_to_list_of_substitutions(predicate_expression)
        super().__init__(predicate=self._evaluate)

    def _evaluate(self, context: LaunchContext) -> bool:
        return evaluate_condition_expression(context, self._expression)


class UnlessCondition(IfCondition):
    """True when the expression is not."""

    def _evaluate(self, context: LaunchContext) -> bool:
        return not super()._evaluate(context)


class LaunchConfigurationEquals(Condition):
    """True when a launch configuration has a value (None: is not set)."""

    def __init__(self, launch_configuration_name: str, expected_value: SomeSubstitutionsType | None) -> None:
        warnings.warn(
            "The 'LaunchConfigurationEquals' and 'LaunchConfigurationNotEquals' Conditions are deprecated. "
            "Use the 'EqualsSubstitution' and 'NotEqualsSubstitution' substitutions instead!",
            UserWarning,
            stacklevel=2,
        )
        self._name = launch_configuration_name
        self._expected = None if expected_value is None else normalize_to_list_of_substitutions(expected_value)
        super().__init__(predicate=self._evaluate)

    def _evaluate(self, context: LaunchContext) -> bool:
        expected = None if self._expected is None else perform_substitutions(context, self._expected)
        return bool(context.launch_configurations.get(self._name) == expected)


class LaunchConfigurationNotEquals(LaunchConfigurationEquals):
    """True when a launch configuration does not have a value."""

    def _evaluate(self, context: LaunchContext) -> bool:
        return not super()._evaluate(context)
