from relume_client import Client

bake = Client().example("still_life").bake("direct", preset="preview").wait(progress=True)
with bake.session() as session:
    session["Bowl"].roughness = 0.3
    image = session.frame(exact=True)
