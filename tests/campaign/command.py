"""`ethogram` with the toy among its studies and faults where the environment asks for them."""

import ethogram.studies
from ethogram.__main__ import main
from ethogram.core.registry import Registry

STUDIES = {"toy": "tests.campaign.faulty_toy", "sharing": "tests.campaign.faulty_sharing"}

ethogram.studies.STUDIES = Registry("study", "ethogram.studies", STUDIES)

if __name__ == "__main__":
    main()
