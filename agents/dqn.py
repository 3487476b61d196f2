"""Deep Q-network on the 27 discrete actions: `python -m agents.dqn --scene dam_break`."""

from stable_baselines3 import DQN

from agents.arguments import parse
from agents.exports import plain_network
from agents.training import Training, TrainingArgs
from sph_gym.controllers import Network


def export(model: DQN) -> Network:
    """Return the network of the values; the policy takes the action of the largest."""
    return plain_network(model.q_net.q_net, "none", "discrete")


def train(args: TrainingArgs) -> None:
    """Train on the training instances; keep the model that is best on the validation instances."""
    training = Training("dqn", args, export, action_mode="discrete")
    envs = training.make_envs()
    if args.resume:
        model = DQN.load(training.checkpoint(), env=envs, device="cpu")
    else:
        model = DQN("MlpPolicy", envs, **training.settings())
    training.learn(model)
    envs.close()


if __name__ == "__main__":
    train(parse(TrainingArgs, __doc__))
