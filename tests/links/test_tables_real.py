"""Every table over sockets and terminals of this machine: the same stories in real time."""

import pytest

from tests.links.test_tables import (  # noqa: F401
    test_a_coil_written_is_read_again_at_once,
    test_a_device_without_coils_has_all_the_rest,
    test_bits_of_a_register_that_the_device_changes_meanwhile_are_not_lost,
    test_coils_are_read_and_written_and_discrete_inputs_read,
    test_every_width_and_order_of_registers_is_read_and_written,
    test_several_coils_are_written_in_one_telegram_and_no_other_with_them,
)

pytestmark = pytest.mark.real_time
