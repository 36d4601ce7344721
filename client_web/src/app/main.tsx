import { render } from "preact";
import { arrive } from "../account/account";
import { Login } from "../account/Login";
import { history } from "../edit/history";
import { resumeRendering } from "../looks/rendering";
import { openShare } from "../looks/share";
import { followThumbnails } from "../looks/thumbnails";
import { openScene } from "../scene/open";
import { followPlace } from "../scene/persistence";
import { placeFromUrl } from "../scene/url";
import { StartPage } from "../start/StartPage";
import { followNetwork } from "../live/connections";
import { followToneMap } from "../live/displayViews";
import { followPanels } from "../state/panels";
import { followTimeline } from "../looks/keyframes";
import { followRoom } from "../state/room";
import { me } from "../state/me";
import { page } from "../state/scene";
import { followName } from "../state/together";
import { recallTruth } from "../truth/truth";
import { keepFocus } from "../ui/keepFocus";
import { Toasts } from "../ui/toasts";
import { Editor } from "./Editor";
import "../ui/base.css";
import "../ui/controls.css";
import "../outline/outline.css";
import "../viewport/viewport.css";
import "../inspector/inspector.css";
import "../looks/looks.css";
import "../start/start.css";
import "../start/bake.css";
import "../curve/curve.css";
import "../library/library.css";
import "../lights/lights.css";
import "../timeline/timeline.css";
import "../truth/truth.css";
import "../account/account.css";
import "../together/together.css";
import "../comments/comments.css";
import "./layout.css";
import "./bars.css";
import "../ui/adapting.css"; // after all that it adapts

function App() {
  const isIn = me.value.role !== "anyone";
  const inEditor = isIn && page.value === "editor"; // which has its own place for messages
  return (
    <>
      {inEditor ? <Editor /> : isIn && <StartPage />}
      {!inEditor && <Toasts />}
      <Login />
    </>
  );
}

async function start(): Promise<void> {
  const isIn = await arrive().catch(() => true); // where the server cannot be reached all else says so
  if (isIn) open();
  render(<App />, document.getElementById("app") as HTMLElement);
}

function open(): void {
  const place = placeFromUrl(location.search, location.hash);
  keepFocus();
  followNetwork();
  followName();
  if (place.share !== null) void openShare(place.share, place);
  else if (place.scene !== null) void openScene(place.scene, place);
  followPlace();
  followPanels();
  followTimeline();
  followRoom();
  followToneMap();
  followThumbnails();
  void resumeRendering();
  void recallTruth(place.bake);
  // one drag is one step, however long it rests on the way; once the hand has left the control, the next is another
  window.addEventListener("pointermove", (event) => event.buttons !== 0 && history.hold(), { capture: true });
  for (const event of ["pointerup", "pointercancel"]) window.addEventListener(event, () => history.seal());
  window.addEventListener("popstate", () => location.reload());
}

void start();
