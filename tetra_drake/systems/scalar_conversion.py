"""Conversion of LeafSystems to AutoDiffXd, for Drake's linearization and trajectory optimization,
and clones.

The laws are compiled for floats, so there is no second version of them for AutoDiffXd. The twin of
a system takes values from the system itself, and derivatives from central differences (relative
errors of about 1e-9). Where a law has a kink, as where a cable goes slack, a derivative is the mean
of both sides.

Drake's plants lose the default poses of free bodies in a conversion, so a context of a converted or
cloned robot needs SetTimeStateAndParametersFrom(). Drake's Linearize refuses diagrams with discrete
states beside continuous ones, as a ground has.
"""

from __future__ import annotations

import contextlib
import functools
import weakref
from collections.abc import Callable
from typing import Any, Self

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import (
    BasicVector_,
    Context,
    DiscreteValues,
    EventStatus,
    LeafSystem,
    LeafSystem_,
    OutputPort,
    PortDataType,
    SystemScalarConverter,
)

from tetra_drake.errors import InputError
from tetra_drake.systems.attachment import DeclareOutput

_STEP, _SHARE = 1e-6, 1e-8
"""Least step of the central differences, in SI units, and least step divided by the number that is
changed. Errors of rounding are about as large as the errors of the difference then."""


class ConvertibleSystem(LeafSystem):
    """LeafSystem that converts to AutoDiffXd, as an AutoDiffTwin, and can be cloned.

    A clone is made by the arguments of the constructor of the original. Input ports are vectors.
    """

    make_again: Callable[[], Self]
    """Function that makes another system by the same arguments."""

    def __new__(cls, *args: Any, **kwargs: Any) -> Self:
        system = super().__new__(cls)
        system.make_again = functools.partial(cls, *args, **kwargs)
        return system

    def __init__(self) -> None:
        super().__init__(_CONVERTER)


class AutoDiffTwin(LeafSystem_[AutoDiffXd]):
    """Twin of a ConvertibleSystem for AutoDiffXd, with the same ports, states and parameters.

    Derivatives are those by the inputs, the continuous state, the parameters and the time. The
    discrete state, such as the modes of contacts, counts as constant. So a simulation of a twin
    that has any raises InputError.
    """

    def __init__(self, make_again: Callable[[], ConvertibleSystem]) -> None:
        super().__init__(_CONVERTER)
        self.make_again, self._system = make_again, make_again()
        context = self._system.CreateDefaultContext()
        inputs = map(self._system.get_input_port, range(self._system.num_input_ports()))
        tickets = [self.DeclareVectorInputPort(x.get_name(), x.size()).ticket() for x in inputs]
        for group in range(context.num_numeric_parameter_groups()):
            parameter = context.get_numeric_parameter(group).value()
            self.DeclareNumericParameter(BasicVector_[AutoDiffXd](parameter))
        if context.num_continuous_states():
            state = context.get_continuous_state_vector().CopyToVector()
            self.DeclareContinuousState(BasicVector_[AutoDiffXd](state))
        if context.num_discrete_state_groups():
            discrete = context.get_discrete_state_vector().CopyToVector()
            self.DeclareDiscreteState(BasicVector_[AutoDiffXd](discrete))
            self.DeclareInitializationDiscreteUpdateEvent(self._refuse)
            self.DeclarePerStepDiscreteUpdateEvent(self._refuse)
        for number in range(self._system.num_output_ports()):
            self._declare_output(self._system.get_output_port(number), tickets)

    def _declare_output(self, port: OutputPort, inputs: list[Any]) -> None:
        """Declares the output port that corresponds to a port of the system. `inputs` are the
        tickets of all input ports."""
        name, number = port.get_name(), port.get_index()
        sources = {self.all_sources_except_input_ports_ticket()} | {
            ticket
            for place, ticket in enumerate(inputs)
            if self._system.HasDirectFeedthrough(place, number)
        }
        if port.get_data_type() == PortDataType.kVectorValued:
            read = functools.partial(AutoDiffTwin._differentiated, read=port.Eval)
            DeclareOutput(self, name, port.size(), read, sources)
            return

        this = weakref.proxy(self)  # its port would keep the twin alive for ever

        def copy(context: Context, output: AbstractValue) -> None:
            output.set_value(port.Eval(this._counterpart(context)[0]))

        self.DeclareAbstractOutputPort(name, port.Allocate, copy, sources)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: Any) -> None:
        """Writes the rates of the continuous state, with their derivatives."""
        if derivatives.size():
            derivatives.SetFromVector(self._differentiated(context, read=self._rates).ravel())

    def _rates(self, of_system: Context) -> np.ndarray:
        return self._system.EvalTimeDerivatives(of_system).CopyToVector()

    def _counterpart(
        self, context: Context
    ) -> tuple[Context, list[tuple[np.ndarray, Callable[[np.ndarray], object]]]]:
        """A context of the system with the values of the twin's `context`; and for each vector that
        may have derivatives, the vector, and a function that sets its values."""
        of_system = self._system.CreateDefaultContext()
        vectors: list[tuple[np.ndarray, Callable[[np.ndarray], object]]] = [
            (np.array([context.get_time()]), lambda values: of_system.SetTime(values[0]))
        ]
        for number in range(self.num_input_ports()):
            port = self.get_input_port(number)
            if port.HasValue(context):
                fix = functools.partial(self._system.get_input_port(number).FixValue, of_system)
                vectors.append((port.Eval(context), fix))
        for group in range(context.num_numeric_parameter_groups()):
            given = context.get_numeric_parameter(group).CopyToVector()
            vectors.append((given, functools.partial(_set_parameter, of_system, group)))
        if context.num_continuous_states():
            state = context.get_continuous_state_vector().CopyToVector()
            vectors.append((state, of_system.SetContinuousState))
        if context.num_discrete_state_groups():
            discrete = context.get_discrete_state_vector().CopyToVector()
            of_system.SetDiscreteState(ExtractValue(discrete).ravel())
        for given, set_values in vectors:
            set_values(ExtractValue(given).ravel())
        return of_system, vectors

    def _differentiated(
        self, context: Context, *, read: Callable[[Context], np.ndarray]
    ) -> np.ndarray:
        """Numbers that `read` gets from a context of the system, with their derivatives by the
        chain rule."""
        of_system, vectors = self._counterpart(context)
        value = np.array(read(of_system))
        gradients = [ExtractGradient(given) for given, _ in vectors]
        counts = {each.shape[1] for each in gradients} - {0}
        if len(counts) > 1:
            problem = f"found {sorted(counts)} derivatives of its inputs, expected one number"
            raise InputError("AutoDiffXd", self.get_name(), problem)
        gradient = np.zeros((value.size, max(counts, default=0)))
        for (given, set_values), of_given in zip(vectors, gradients, strict=True):
            start = ExtractValue(given).ravel()
            for place in of_given.any(axis=1).nonzero()[0].tolist():
                found, shift = {start[place]: value}, max(_STEP, _SHARE * abs(start[place]))
                for moved in (start[place] - shift, start[place] + shift):
                    values = start.copy()
                    values[place] = moved
                    set_values(values)
                    with contextlib.suppress(InputError):  # at a limit: the difference on one side
                        found[moved] = np.array(read(of_system))
                before, after = min(found), max(found)
                slopes = (found[after] - found[before]) / (after - before)
                gradient += slopes[:, np.newaxis] * of_given[place]
            set_values(start)
        return InitializeAutoDiff(value, gradient)

    def _refuse(self, context: Context, values: DiscreteValues) -> EventStatus:
        problem = "has a discrete state, which is constant for AutoDiffXd; simulate with floats"
        raise InputError("AutoDiffXd", self.get_name(), problem)


def _set_parameter(context: Context, group: int, values: np.ndarray) -> None:
    # Drake forgets cached values when the vector is fetched, not when it is written.
    context.get_mutable_numeric_parameter(group).SetFromVector(values)


def _named(made: Any, original: Any) -> Any:
    made.set_name(original.get_name())
    return made


_CONVERTER = SystemScalarConverter()
_CONVERTER._AddConstructor[AutoDiffXd, float](lambda one: _named(AutoDiffTwin(one.make_again), one))
_CONVERTER._AddConstructor[float, AutoDiffXd](lambda twin: _named(twin.make_again(), twin))
