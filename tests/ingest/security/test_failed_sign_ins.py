from ingest.security.failed_sign_ins import FORGIVEN_AFTER_S, FREE, LONGEST_S, MOST_ADDRESSES, FailedSignIns


def test_each_further_wrong_token_of_an_address_is_answered_later_up_to_a_limit() -> None:
    failed = FailedSignIns()
    delays_s = [failed.delay_s("10.0.0.1", 0.0) for _ in range(50)]
    assert delays_s[:FREE] == [0.0] * FREE
    assert delays_s == sorted(delays_s)
    assert delays_s[-1] == LONGEST_S
    assert failed.delay_s("10.0.0.2", 0.0) == 0.0


def test_wrong_tokens_are_forgotten_with_time() -> None:
    failed = FailedSignIns()
    for _ in range(10):
        failed.delay_s("10.0.0.1", 0.0)
    assert failed.delay_s("10.0.0.1", 11 * FORGIVEN_AFTER_S) == 0.0


def test_addresses_are_bounded() -> None:
    failed = FailedSignIns()
    for number in range(2 * MOST_ADDRESSES):
        failed.delay_s(f"2001:db8::{number:x}", 0.0)
    assert len(failed._addresses) == MOST_ADDRESSES
