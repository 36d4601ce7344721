/** A place in the editor as the address says it. */

export interface Place {
  scene: string | null;
  bake: string | null;
  view: string | null;
  /** The views that are shown side by side; empty where one is shown alone. */
  beside: string[];
  material: string | null;
  term: number;
  curve: string | null;
  light: string | null;
  /** What opens the room that the look is shared in, to edit or only to watch. It stands in the fragment, which browsers
   * send to nobody. */
  room: string | null;
  watch: string | null;
  /** The shared look that it begins with. */
  share: string | null;
}

export function placeFromUrl(search: string, hash = ""): Place {
  const query = new URLSearchParams(search);
  const secrets = new URLSearchParams(hash.slice(1));
  return {
    scene: query.get("scene"),
    bake: query.get("bake"),
    view: query.get("view"),
    beside: query.getAll("beside"),
    material: query.get("material"),
    term: Math.max(0, Math.trunc(Number(query.get("term") ?? 0)) || 0),
    curve: query.get("curve"),
    light: query.get("light"),
    room: secrets.get("room"),
    watch: secrets.get("watch"),
    share: query.get("share"),
  };
}

export function placeToUrl(place: Place): string {
  const query = new URLSearchParams();
  for (const key of ["scene", "bake", "view", "material", "curve", "light"] as const) {
    if (place[key] !== null && place[key] !== "") query.set(key, place[key]);
  }
  for (const view of place.beside) query.append("beside", view);
  if (place.material !== null && place.term > 0) query.set("term", String(place.term));
  const key = place.room !== null ? "room" : place.watch !== null ? "watch" : null;
  const hash = key === null ? "" : `#${keyFragment(key, place[key] as string)}`;
  return (query.size > 0 ? `?${query.toString()}` : "/") + hash;
}

/** What the fragment of an address says of a room. */
export function keyFragment(kind: "room" | "watch", key: string): string {
  return new URLSearchParams({ [kind]: key }).toString();
}
