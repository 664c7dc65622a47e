"""Write the version of its env into the card of each policy that ships, without training it anew.

    python scripts/identify_policies.py

To be run after a change of an env's model or of the fingerprint that leaves the policies valid.
Cards of clones of vehicles name no model, and stay as they are.
"""

from __future__ import annotations

import json
from pathlib import Path

import msgspec

import shapechanger  # noqa: F401  # Registers the ids.
from shapechanger.contract.env_ref import EnvRef
from shapechanger.files import write_atomic
from shapechanger.finger.policies import POLICIES
from shapechanger.tensor_file import read_tensors, tensor_bytes
from shapechanger.transfer.references import FOLDER
from shapechanger.transfer.versions import ENV, identify, known


def state_identity(file: Path) -> str:
    """Write the identity of its env into the card of a policy.

    Args:
        file: The policy.

    Returns:
        The fingerprint of the env's model; empty without a model.
    """
    content, tensors = read_tensors(file)
    card = json.loads(content)
    identity = identify(msgspec.convert(card["env"], EnvRef)).identity
    card["identity"] = msgspec.to_builtins(known({ENV: identity}))
    write_atomic(file, tensor_bytes(tensors, msgspec.json.encode(card)))
    return identity.model


def main() -> None:
    """Write the cards of all shipped policies, and print their fingerprints."""
    for file in (*sorted(FOLDER.glob("*.safetensors")), *POLICIES.values()):
        print(file.name, state_identity(file) or "has no model")


if __name__ == "__main__":
    main()
