from relume_client import Client

bake = Client().example("still_life").bake("direct", size=(320, 240)).wait(progress=True)
with bake.session() as session:
    session["Bowl"].roughness = 0.3
    image = session.frame(exact=True)
