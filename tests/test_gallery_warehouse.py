"""The scenarios of the gallery in the warehouse, from the file to the verdict."""

import pytest
from gallery_facts import GalleryFacts, files, verified


@pytest.fixture(scope="module", params=files(of_the_warehouse=True), ids=lambda file: file.stem)
def folder(request, tmp_path_factory):
    return verified(request.param, tmp_path_factory.mktemp("gallery"))


class TestWarehouse(GalleryFacts):
    pass
