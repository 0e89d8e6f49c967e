import pytest

from deconflict.operator.outlets.webhook_signatures import SignatureError, signed, verified
from tests.helpers.made_advisories import made

NOW_S = 1_792_000_000.4
BODY = made(1).model_dump_json().encode()


def test_the_signature_follows_the_specification() -> None:
    """The example of Standard Webhooks 1.0."""
    coded = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"
    headers = signed("msg_p5jXN8AQM9LWM0D4loKWxJek", b'{"test": 2432232314}', coded, 1614265330)
    assert headers["webhook-signature"] == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


def test_a_signed_request_is_verified() -> None:
    assert verified(signed("advisory-1", BODY, "shared", NOW_S), BODY, "shared", NOW_S + 20) == made(1)


def test_one_valid_signature_of_several_is_enough() -> None:
    headers = signed("advisory-1", BODY, "shared", NOW_S)
    headers["webhook-signature"] = "v1,AAAA " + headers["webhook-signature"]
    assert verified(headers, BODY, "shared", NOW_S)


@pytest.mark.parametrize(
    ("changed", "body", "secret", "now_s"),
    [
        ({}, BODY + b" ", "shared", NOW_S),
        ({}, BODY, "another", NOW_S),
        ({}, BODY, "shared", NOW_S + 301),
        ({"webhook-id": "advisory-2"}, BODY, "shared", NOW_S),
        ({"webhook-timestamp": "1792000001"}, BODY, "shared", NOW_S),
        ({"webhook-timestamp": "today"}, BODY, "shared", NOW_S),
        ({"webhook-signature": "v1,é"}, BODY, "shared", NOW_S),
        ({"webhook-signature": ""}, BODY, "shared", NOW_S),
    ],
)
def test_a_changed_request_is_not_verified(changed: dict[str, str], body: bytes, secret: str, now_s: float) -> None:
    headers = signed("advisory-1", BODY, "shared", NOW_S) | changed
    with pytest.raises(SignatureError, match="webhook-"):
        verified(headers, body, secret, now_s)
