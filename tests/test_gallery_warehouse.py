"""The scenarios of the gallery in the warehouse, from the file to the verdict."""

import pytest
from gallery_facts import GalleryFacts, names
from gallery_runs import verified


@pytest.fixture(scope="module", params=names(of_the_warehouse=True))
def folder(request, tmp_path_factory):
    return verified(request.param, tmp_path_factory)


class TestWarehouse(GalleryFacts):
    pass
