"""What the check of a chain costs grows as its number of links."""

import jax.numpy as jnp
import numpy as np

import coadjoint as co
from coadjoint.kernels.newton import coupled


def test_the_order_of_links_is_asked_for_as_often_whatever_their_number(monkeypatch):
    asked, found = [], coupled.layout
    monkeypatch.setattr(coupled, "layout", lambda *links: asked.append(1) or found(*links))
    counts = []
    for count in (50, 100):
        chain = co.System(co.Power(co.SO3(), count), lambda xi: 0.5 * jnp.sum(xi**2), name="links")
        asked.clear()
        chain.check(chain.state(xi=0.1 * np.sin(np.arange(3.0 * count))))
        counts.append(len(asked))
    assert counts[0] == counts[1] > 0
