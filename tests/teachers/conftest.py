import pytest
from zips import made


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    """The zip of an untrained agent, which shows no sign of a normalisation."""
    made("SAC", net_arch=[16, 12], activation_fn="Tanh").save(path := tmp_path_factory.mktemp("agents") / "small.zip")
    return path
