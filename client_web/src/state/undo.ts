/** Undo and redo for buttons and keys: what cannot be undone now is said, and stays to be undone later. */
import { attempt } from "../ui/toasts";
import { history } from "./store";

export const undo = () => void attempt(() => history.undo());
export const redo = () => void attempt(() => history.redo());
export const goTo = (count: number) => void attempt(() => history.goTo(count));
