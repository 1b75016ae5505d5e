"""Every scenario of the gallery but those in the warehouse, from the file to the verdict."""

import pytest
from gallery_facts import GalleryFacts, files, verified


@pytest.fixture(scope="module", params=files(of_the_warehouse=False), ids=lambda file: file.stem)
def folder(request, tmp_path_factory):
    return verified(request.param, tmp_path_factory.mktemp("gallery"))


class TestGallery(GalleryFacts):
    pass
