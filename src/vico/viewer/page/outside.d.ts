// What the page imports that is not beside it: the 3D library of the asset pack, and the module for players.
export const THREE: any;
export function start(vico: any): void;
declare global {
  interface Window {
    vico: any;
  }
}
