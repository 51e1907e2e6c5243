"""The arm in three dimensions: a recording that plays inside a page, with everything it needs in it."""

from collections.abc import Sequence

from sec_lab.worlds.katana import Move, Run, Scene


def arm_page(scene: Scene, moves: Sequence[Move]) -> str:
    """A page of its own in which the moves of the arm can be played and scrubbed.

    Parameters
    ----------
    scene : Scene
    moves : sequence of Move

    Returns
    -------
    str
        HTML without any address in need of a network; about 2 MB.

    Raises
    ------
    UnreachableError
        If a move is out of reach.
    """
    from pydrake.geometry import Meshcat

    meshcat = Meshcat()
    meshcat.SetProperty("/Background", "visible", value=False)
    run = Run(scene, film=False, meshcat=meshcat)
    meshcat.StartRecording(frames_per_second=20.0, set_visualizations_while_recording=False)
    for move in moves:
        run.move(move)
    meshcat.StopRecording()
    meshcat.PublishRecording()
    return str(meshcat.StaticHtml())
