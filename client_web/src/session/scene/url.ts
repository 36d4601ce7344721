/** The editor's state in the URL. */

export interface UrlState {
  scene: string | null;
  bake: string | null;
  view: string | null;
  /** The views shown side by side; empty if one is shown alone. */
  sideBySide: string[];
  material: string | null;
  term: number;
  curve: string | null;
  light: string | null;
  /** Key of the room, to edit or only to watch. In the URL's fragment, which browsers do not send to servers. */
  room: string | null;
  watch: string | null;
  /** The shared look that the room starts with. */
  share: string | null;
}

export function parseUrl(search: string, hash = ""): UrlState {
  const query = new URLSearchParams(search);
  const secrets = new URLSearchParams(hash.slice(1));
  return {
    scene: query.get("scene"),
    bake: query.get("bake"),
    view: query.get("view"),
    sideBySide: query.getAll("beside"),
    material: query.get("material"),
    term: Math.max(0, Math.trunc(Number(query.get("term") ?? 0)) || 0),
    curve: query.get("curve"),
    light: query.get("light"),
    room: secrets.get("room"),
    watch: secrets.get("watch"),
    share: query.get("share"),
  };
}

export function formatUrl(urlState: UrlState): string {
  const query = new URLSearchParams();
  for (const key of ["scene", "bake", "view", "material", "curve", "light"] as const) {
    if (urlState[key] !== null && urlState[key] !== "") query.set(key, urlState[key]);
  }
  for (const view of urlState.sideBySide) query.append("beside", view);
  if (urlState.material !== null && urlState.term > 0) query.set("term", String(urlState.term));
  const key = urlState.room !== null ? "room" : urlState.watch !== null ? "watch" : null;
  const hash = key === null ? "" : `#${keyFragment(key, urlState[key] as string)}`;
  return (query.size > 0 ? `?${query.toString()}` : "/") + hash;
}

/** The room in a URL's fragment. */
export function keyFragment(kind: "room" | "watch", key: string): string {
  return new URLSearchParams({ [kind]: key }).toString();
}
