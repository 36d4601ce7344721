/** Which part of each picture is on the screen: the server makes that exact before the rest. */
import { effect } from "@preact/signals";
import { stage } from "../picture/stage";
import { regionOf } from "../picture/transform";
import { transformOf } from "../picture/viewTransforms";
import { drawn } from "../state/display";
import { connections, type BakeConnection } from "./connections";
import { shownOf } from "./tellViews";

/** A hand that zooms or pans is told of when it holds still. */
const STILL_MS = 150;

/** Say it of the views whose pictures are baked, where it is news. */
export function tellRegions(of: BakeConnection | null): void {
  if (!of?.hello) return;
  const shown = shownOf(of.hello);
  for (const { name, eye, width, height } of of.hello.views) {
    const screen = stage.of(name).screen;
    if (eye === "free" || screen === null || !shown.includes(name)) continue;
    const canvas = { ...screen.size(), aspect: width / height };
    const rect = regionOf(transformOf(name), canvas, width, height);
    const text = JSON.stringify(rect);
    if (text === (of.toldRegions.get(name) ?? "null")) continue;
    if (of.session.send({ type: "region", view: name, rect })) of.toldRegions.set(name, text);
  }
}

effect(() => {
  drawn.value;
  const timer = setTimeout(() => {
    tellRegions(connections.shown);
    tellRegions(connections.incoming);
  }, STILL_MS);
  return () => clearTimeout(timer);
});
