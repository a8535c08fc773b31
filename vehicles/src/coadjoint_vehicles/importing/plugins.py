"""The plugins of Gazebo in a description."""

from __future__ import annotations

from coadjoint.models.descriptions.elements import Element


def plugins_of(root: Element) -> list[Element]:
    """The plugins in all <gazebo> of a description."""
    found = []
    for gazebo in root.children:
        if gazebo.tag == "gazebo" and any(child.tag == "plugin" for child in gazebo.children):
            gazebo.taken = True
            found += [child for child in gazebo.children if child.tag == "plugin"]
    return found


def plugins_named(plugins: list[Element], *words: str) -> list[Element]:
    """Those whose file or name has one of these words; they count as read."""
    found = []
    for plugin in plugins:
        said = f"{plugin.attributes.get('filename', '')} {plugin.attributes.get('name', '')}".lower()
        if any(word in said for word in words):
            plugin.taken = True
            plugin.get("filename")
            found.append(plugin)
    return found
